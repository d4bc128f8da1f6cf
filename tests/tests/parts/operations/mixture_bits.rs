//! Bits under mixtures of logistics against plain operations of Burn and their derivatives, and against differences of a plain
//! float64 twin, which shares no code with the operation.

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::ops::mixture_bits::{MOST_COMPONENTS, MixtureInputs, mixture_bits};
use light4gs_model::{LogisticMixture, LogisticMixtureConfig};
use light4gs_tests::golden::{assert_close, assert_close_relative, cpu_devices, devices, values_of};
use light4gs_tests::random::Random;

const INPUTS: [&str; 5] = ["values", "widths", "weight_logits", "means", "log_scales"];
const BOUND: f32 = 1e-9;

#[derive(Clone)]
struct Case {
    channels: usize,
    /// In the order of [`INPUTS`], row by row.
    inputs: [Vec<f64>; 5],
}

impl Case {
    /// Values near the means and far from them, intervals narrow and wide.
    fn random(channels: usize, count: usize, components: usize, random: &mut Random) -> Self {
        let mut uniform = |count: usize, low: f64, high: f64| -> Vec<f64> {
            (0..count).map(|_| f64::from(random.uniform(low, high) as f32)).collect()
        };
        let inputs = [
            uniform(channels * count, -2.0, 2.0),
            uniform(channels, 0.01, 0.5),
            uniform(channels * components, -1.0, 1.0),
            uniform(channels * components, -0.5, 0.5),
            uniform(channels * components, -3.0, 0.0),
        ];
        Self { channels, inputs }
    }

    /// Bits, and gradients of their sum with `weights`.
    fn run(
        &self,
        device: &Device,
        weights: &[f32],
        operation: impl Fn(MixtureInputs) -> Tensor<1>,
    ) -> (Vec<f32>, [Vec<f32>; 5]) {
        let device = device.clone().autodiff();
        let leaves: [Tensor<2>; 5] = std::array::from_fn(|k| {
            let values: Vec<f32> = self.inputs[k].iter().map(|value| *value as f32).collect();
            let shape = [self.channels, values.len() / self.channels];
            Tensor::from_data(TensorData::new(values, shape), &device).require_grad()
        });
        let [values, widths, weight_logits, means, log_scales] = leaves.clone();
        let bits = operation(MixtureInputs { values, widths, weight_logits, means, log_scales });
        let gradients = (bits.clone() * Tensor::from_floats(weights, &device)).sum().backward();
        (values_of(&bits), leaves.map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient"))))
    }

    /// Bits of each channel in float64.
    fn twin(&self) -> Vec<f64> {
        let [values, widths, weight_logits, means, log_scales] = &self.inputs;
        let (count, components) = (values.len() / self.channels, means.len() / self.channels);
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let likelihood = |channel: usize, value: f64| {
            let own = channel * components..(channel + 1) * components;
            let total: f64 = weight_logits[own.clone()].iter().map(|logit| logit.exp()).sum();
            let mass = |k: usize| {
                // On the side where the logistic function is small.
                let distance = -(value - means[k]).abs();
                let edge = |side: f64| sigmoid((distance + side * widths[channel]) / log_scales[k].exp());
                weight_logits[k].exp() / total * (edge(0.5) - edge(-0.5))
            };
            own.map(mass).sum::<f64>()
        };
        let bits = |channel: usize| {
            let own = &values[channel * count..(channel + 1) * count];
            own.iter().map(|value| -likelihood(channel, *value).max(f64::from(BOUND)).log2()).sum()
        };
        (0..self.channels).map(bits).collect()
    }
}

/// The operation in plain ones.
fn plain(inputs: MixtureInputs) -> Tensor<1> {
    let MixtureInputs { values, widths, weight_logits, means, log_scales } = inputs;
    let [channels, components] = means.dims();
    let mut mixture: LogisticMixture =
        LogisticMixtureConfig::new(channels).with_components(components).init(&values.device());
    let put = |value: Tensor<2>| burn::module::Param::initialized(burn::module::ParamId::new(), value);
    mixture.weight_logits = put(weight_logits);
    mixture.means = put(means);
    mixture.log_scales = put(log_scales);
    let likelihood = lower_bound(mixture.interval_likelihood(values, widths), BOUND);
    (likelihood.log() * -std::f64::consts::LOG2_E).sum_dim(1).squeeze_dim(1)
}

fn fused(inputs: MixtureInputs) -> Tensor<1> {
    mixture_bits(inputs, BOUND)
}

const SIZES: [[usize; 2]; 5] = [[1, 1], [3, 8], [2, 63], [26, 500], [5, 3001]];

fn cases() -> impl Iterator<Item = (String, Case, Vec<f32>)> {
    SIZES.into_iter().enumerate().flat_map(|(seed, [channels, count])| {
        (1..=MOST_COMPONENTS).map(move |components| {
            let mut random = Random::new(600 + seed as u64);
            let case = Case::random(channels, count, components, &mut random);
            // Some channels shall have more bits.
            let weights = random.normals(channels).iter().map(|weight| *weight as f32).collect();
            (format!("{channels} channels of {count} values, {components} logistics"), case, weights)
        })
    })
}

#[test]
fn bits_and_gradients_are_those_of_plain_operations() {
    for (what, case, weights) in cases() {
        let expected = case.run(&Device::flex(), &weights, plain);
        for (name, device) in devices() {
            let found = case.run(&device, &weights, fused);
            let what = format!("{name}, {what}");
            assert_close_relative(&format!("{what}: bits"), &found.0, &expected.0, 1e-5);
            for (k, input) in INPUTS.iter().enumerate() {
                assert_close_relative(&format!("{what}: gradient of {input}"), &found.1[k], &expected.1[k], 5e-4);
            }
        }
    }
}

/// Where the plain operations lose digits: in intervals that are narrow or wide beside the scale.
#[test]
fn gradients_are_differences_of_a_float64_twin() {
    let mut random = Random::new(640);
    for [widths, log_scales] in [[0.01, -2.0], [1e-4, 0.0], [0.5, -3.0], [0.05, -3.0]] {
        let mut case = Case::random(2, 21, 3, &mut random);
        case.inputs[1].fill(widths);
        case.inputs[4].fill(log_scales);
        // So near that no likelihood is below the bound, where the derivative is not that of the value.
        case.inputs[0].iter_mut().for_each(|value| *value *= 2.0 * log_scales.exp());
        case.inputs[3].iter_mut().for_each(|mean| *mean *= log_scales.exp());
        let expected = case.twin();
        let weights = [1.0, -0.5];
        let difference = |k: usize, i: usize| {
            let h = 1e-6;
            let moved = |by: f64| {
                let mut moved = case.clone();
                moved.inputs[k][i] += by;
                moved.twin().iter().zip(weights).map(|(bits, weight)| bits * f64::from(weight)).sum::<f64>()
            };
            ((moved(h) - moved(-h)) / (2.0 * h)) as f32
        };
        for (name, device) in devices() {
            let (bits, gradients) = case.run(&device, &weights, fused);
            let what = format!("{name}, widths {widths}, scales e^{log_scales}");
            let expected: Vec<f32> = expected.iter().map(|bits| *bits as f32).collect();
            assert_close_relative(&format!("{what}: bits"), &bits, &expected, 1e-5);
            for (k, input) in INPUTS.iter().enumerate() {
                let expected: Vec<f32> = (0..case.inputs[k].len()).map(|i| difference(k, i)).collect();
                let largest = expected.iter().fold(0.0f32, |most, value| most.max(value.abs()));
                assert_close(&format!("{what}: gradient of {input}"), &gradients[k], &expected, 2e-4 * largest + 1e-4);
            }
        }
    }
}

/// Below the bound a gradient passes only where a step along it would raise the likelihood.
#[test]
fn far_values_come_back() {
    let case = Case {
        channels: 2,
        inputs: [vec![0.1, 9.0, 0.1, 9.0], vec![0.1; 2], vec![0.0; 2], vec![0.0; 2], vec![-2.0; 2]],
    };
    for (name, device) in devices() {
        let (bits, gradients) = case.run(&device, &[1.0, -1.0], fused);
        assert!((bits[0] - bits[1]).abs() < 1e-5 && bits[0] > 29.8, "{name}: {bits:?}");
        let [of_values, ..] = &gradients;
        assert!(of_values[1].abs() < 1e-3, "{name}: the mass there has no slope: {of_values:?}");
        assert!(of_values[0] > 0.1 && of_values[2] < -0.1 && of_values[3] == 0.0, "{name}: {of_values:?}");
    }
}

#[test]
fn what_is_not_a_number_stays_so() {
    let mut case = Case::random(2, 9, 3, &mut Random::new(650));
    case.inputs[0][3] = f64::NAN;
    // WGSL promises nothing about them.
    for (name, device) in cpu_devices() {
        let (bits, _) = case.run(&device, &[1.0, 1.0], fused);
        assert!(bits[0].is_nan() && bits[1].is_finite(), "{name}: {bits:?}");
    }
}

#[test]
fn no_values_have_no_bits() {
    let case = Case { channels: 2, inputs: [vec![], vec![0.1; 2], vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]] };
    for (name, device) in devices() {
        let (bits, gradients) = case.run(&device, &[1.0, 1.0], fused);
        assert_eq!(bits, [0.0, 0.0], "{name}");
        assert!(gradients.iter().flatten().all(|gradient| *gradient == 0.0), "{name}: {gradients:?}");
    }
}
