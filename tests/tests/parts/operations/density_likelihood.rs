//! Probabilities of intervals under learned densities against plain operations of Burn and their derivatives, and against differences
//! of a plain float64 twin, which shares only the places of the parameters with the operation.

use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::ops::density_likelihood::{DensityShape, density_likelihood};
use light4gs_model::{FactorizedDensity, FactorizedDensityConfig};
use light4gs_tests::golden::{assert_close, cpu_devices, devices, values_of};
use light4gs_tests::random::Random;

const INPUTS: [&str; 2] = ["values", "parameters"];

/// Widths of the hidden layers, and whether the last layer bends: the latents' density, that of the harmonics, no hidden layer, and
/// widths that differ.
const SHAPES: [(&[usize], bool); 5] =
    [(&[3, 3, 3, 3], false), (&[3, 3, 3], true), (&[], false), (&[3, 1, 2], false), (&[2], true)];

/// More than one block of a kernel's values in the last.
const SIZES: [[usize; 2]; 5] = [[1, 1], [3, 8], [2, 63], [26, 500], [2, 5001]];

#[derive(Clone)]
struct Case {
    channels: usize,
    filters: Vec<usize>,
    bend_last_layer: bool,
    width: f32,
    /// In the order of [`INPUTS`], row by row.
    inputs: [Vec<f64>; 2],
}

impl Case {
    /// Values on both sides of the median, and near it.
    fn random((filters, bend_last_layer): (&[usize], bool), [channels, count]: [usize; 2], seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut uniform = |count: usize, low: f64, high: f64| -> Vec<f64> {
            (0..count).map(|_| f64::from(random.uniform(low, high) as f32)).collect()
        };
        let parameters = DensityShape::new(filters, bend_last_layer).parameters();
        let inputs = [uniform(channels * count, -2.0, 2.0), uniform(channels * parameters, -1.0, 1.0)];
        Self { channels, filters: filters.to_vec(), bend_last_layer, width: 0.5, inputs }
    }

    fn shape(&self) -> DensityShape {
        DensityShape::new(&self.filters, self.bend_last_layer)
    }

    fn what(&self) -> String {
        let count = self.inputs[0].len() / self.channels;
        format!("{} channels of {count} values, layers {:?}, {}", self.channels, self.filters, self.bend_last_layer)
    }

    /// For each value another upstream gradient.
    fn weights(&self) -> Vec<f32> {
        let mut random = Random::new(700);
        (0..self.inputs[0].len()).map(|_| random.uniform(-1.0, 1.0) as f32).collect()
    }

    fn tensors(&self, device: &Device) -> [Tensor<2>; 2] {
        std::array::from_fn(|k| {
            let values: Vec<f32> = self.inputs[k].iter().map(|value| *value as f32).collect();
            let shape = [self.channels, values.len() / self.channels];
            Tensor::from_data(TensorData::new(values, shape), device)
        })
    }

    /// Probabilities, and gradients of their sum with [`Self::weights`].
    fn run(
        &self,
        device: &Device,
        operation: impl Fn(&Self, Tensor<2>, Tensor<2>) -> Tensor<2>,
    ) -> (Vec<f32>, [Vec<f32>; 2]) {
        let device = device.clone().autodiff();
        let leaves = self.tensors(&device).map(Tensor::require_grad);
        let [values, parameters] = leaves.clone();
        let likelihoods = operation(self, values, parameters);
        let weights = Tensor::<2>::from_data(TensorData::new(self.weights(), likelihoods.dims()), &device);
        let gradients = (likelihoods.clone() * weights).sum().backward();
        (values_of(&likelihoods), leaves.map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient"))))
    }

    /// Logit of a channel's distribution function in float64.
    fn logit(&self, channel: usize, x: f64) -> f64 {
        let shape = self.shape();
        let parameters = &self.inputs[1][channel * shape.parameters()..(channel + 1) * shape.parameters()];
        let mut logits = vec![x];
        for layer in shape.layers() {
            let next = (0..layer.outputs).map(|o| {
                let softplus = |i: usize| parameters[layer.matrix()][o * layer.inputs + i].exp().ln_1p();
                let product: f64 = (0..layer.inputs).map(|i| softplus(i) * logits[i]).sum();
                let sum = product + parameters[layer.bias()][o];
                let factor = layer.factor().map_or(0.0, |places| parameters[places][o].tanh());
                sum + factor * sum.tanh()
            });
            logits = next.collect();
        }
        logits[0]
    }

    /// Probabilities in float64.
    fn twin(&self) -> Vec<f64> {
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let half = f64::from(self.width) / 2.0;
        let count = self.inputs[0].len() / self.channels;
        let likelihood = |(k, value): (usize, &f64)| {
            let edge = |side: f64| sigmoid(self.logit(k / count, value + side * half));
            edge(1.0) - edge(-1.0)
        };
        self.inputs[0].iter().enumerate().map(likelihood).collect()
    }

    /// The twin's derivative by an input.
    fn difference(&self, k: usize, i: usize) -> f32 {
        let h = 1e-6;
        let moved = |by: f64| {
            let mut moved = self.clone();
            moved.inputs[k][i] += by;
            let weighted = moved.twin().into_iter().zip(self.weights());
            weighted.map(|(likelihood, weight)| likelihood * f64::from(weight)).sum::<f64>()
        };
        ((moved(h) - moved(-h)) / (2.0 * h)) as f32
    }
}

/// The operation in plain ones.
fn plain(case: &Case, values: Tensor<2>, parameters: Tensor<2>) -> Tensor<2> {
    let mut density: FactorizedDensity = FactorizedDensityConfig::new(case.channels)
        .with_filters(case.filters.clone())
        .with_bend_last_layer(case.bend_last_layer)
        .init(&values.device());
    density.parameters = Param::initialized(ParamId::new(), parameters);
    let half = case.width / 2.0;
    let [lower, upper] = [-half, half].map(|side| density.logits(values.clone() + side));
    // On the side where the logistic function is small.
    let side = (lower.clone() + upper.clone()).detach().greater_elem(0.0).float() * -2.0 + 1.0;
    // Clamped, or the gradient of a logistic function far below zero would be infinity times 0.
    let sigmoid = |logit: Tensor<2>| ((logit * side.clone()).clamp_min(-60.0).neg().exp() + 1.0).recip();
    (sigmoid(upper) - sigmoid(lower)).abs()
}

fn fused(case: &Case, values: Tensor<2>, parameters: Tensor<2>) -> Tensor<2> {
    density_likelihood(values, parameters, &case.shape(), case.width)
}

/// Fails unless all are near, in units of the largest, or of 0.1 where that is less.
fn assert_near(what: &str, found: &[f32], expected: &[f32], share: f32) {
    let largest = expected.iter().fold(0.1f32, |most, value| most.max(value.abs()));
    assert_close(what, found, expected, share * largest);
}

#[test]
fn probabilities_and_gradients_are_those_of_plain_operations() {
    for (k, shape) in SHAPES.into_iter().enumerate() {
        for (l, size) in SIZES.into_iter().enumerate() {
            let case = Case::random(shape, size, 710 + (k * SIZES.len() + l) as u64);
            let expected = case.run(&Device::flex(), plain);
            for (name, device) in devices() {
                let found = case.run(&device, fused);
                let what = format!("{name}, {}", case.what());
                assert_near(&format!("{what}: probabilities"), &found.0, &expected.0, 1e-5);
                for (k, input) in INPUTS.iter().enumerate() {
                    assert_near(&format!("{what}: gradient of {input}"), &found.1[k], &expected.1[k], 1e-4);
                }
            }
        }
    }
}

#[test]
fn gradients_are_differences_of_a_float64_twin() {
    for (k, shape) in SHAPES.into_iter().enumerate() {
        for width in [0.02, 0.5, 2.0] {
            let case = Case { width, ..Case::random(shape, [2, 21], 740 + k as u64) };
            let likelihoods: Vec<f32> = case.twin().into_iter().map(|likelihood| likelihood as f32).collect();
            for (name, device) in devices() {
                let found = case.run(&device, fused);
                let what = format!("{name}, {}, width {width}", case.what());
                assert_near(&format!("{what}: probabilities"), &found.0, &likelihoods, 1e-5);
                for (k, input) in INPUTS.iter().enumerate() {
                    let expected: Vec<f32> = (0..case.inputs[k].len()).map(|i| case.difference(k, i)).collect();
                    assert_near(&format!("{what}: gradient of {input}"), &found.1[k], &expected, 5e-5);
                }
            }
        }
    }
}

/// The logits that the auxiliary loss takes come from the same parameters as the probabilities.
#[test]
fn logits_and_probabilities_of_a_density_belong_together() {
    let case = Case::random(SHAPES[0], [3, 40], 760);
    for (name, device) in devices() {
        let mut density = FactorizedDensityConfig::new(3).init(&device);
        let [values, parameters] = case.tensors(&device);
        density.parameters = Param::from_tensor(parameters);
        let twin: Vec<f32> = (0..120).map(|k| case.logit(k / 40, case.inputs[0][k]) as f32).collect();
        assert_near(&format!("{name}: logits"), &values_of(&density.logits_of_frozen(values.clone())), &twin, 1e-5);
        let host = density.to_plain();
        let logits: Vec<f32> = (0..120).map(|k| host.logit(k / 40, case.inputs[0][k]) as f32).collect();
        assert_near(&format!("{name}: logits on the host"), &logits, &twin, 1e-6);
        let likelihoods = values_of(&density.interval_likelihood(values, case.width));
        let twin: Vec<f32> = case.twin().into_iter().map(|likelihood| likelihood as f32).collect();
        assert_near(&format!("{name}: probabilities"), &likelihoods, &twin, 1e-5);
    }
}

/// Far out, where float32 knows no difference of the edges, nothing is divided by it.
#[test]
fn far_values_have_neither_probability_nor_gradient() {
    for shape in SHAPES {
        let mut case = Case::random(shape, [2, 2], 770);
        case.inputs[0] = vec![-1e4, 1e4, 1e4, -1e4];
        for (name, device) in devices() {
            let (likelihoods, gradients) = case.run(&device, fused);
            let what = format!("{name}, {}", case.what());
            assert!(likelihoods.iter().all(|likelihood| *likelihood <= 1e-20), "{what}: {likelihoods:?}");
            assert!(gradients.iter().flatten().all(|gradient| gradient.abs() <= 1e-16), "{what}: {gradients:?}");
        }
    }
}

#[test]
fn what_is_not_a_number_stays_so() {
    let of_value = |case: &mut Case| case.inputs[0][3] = f64::NAN;
    let of_parameter = |case: &mut Case| case.inputs[1][0] = f64::NAN;
    for (spoil, numbers) in [(&of_value as &dyn Fn(&mut Case), 17), (&of_parameter, 9)] {
        let mut case = Case::random(SHAPES[0], [2, 9], 780);
        spoil(&mut case);
        // WGSL promises nothing about them.
        for (name, device) in cpu_devices() {
            let (likelihoods, _) = case.run(&device, fused);
            assert!(likelihoods[3].is_nan() && likelihoods[9..].iter().all(|value| value.is_finite()), "{name}");
            assert_eq!(likelihoods.iter().filter(|value| value.is_finite()).count(), numbers, "{name}");
        }
    }
}

#[test]
fn no_values_have_no_probabilities() {
    let case = Case { inputs: [vec![], vec![0.5; 2 * 58]], ..Case::random(SHAPES[0], [2, 1], 790) };
    for (name, device) in devices() {
        let [values, parameters] = case.tensors(&device);
        assert_eq!(fused(&case, values, parameters).dims(), [2, 0], "{name}");
    }
    for (name, device) in cpu_devices() {
        let (likelihoods, gradients) = case.run(&device, fused);
        assert!(likelihoods.is_empty() && gradients[0].is_empty(), "{name}");
        assert_eq!(gradients[1], vec![0.0; 2 * 58], "{name}");
    }
}

#[test]
#[should_panic(expected = "filters are [3, 4]: a density has at most 4 hidden layers, of width 1 to 3")]
fn a_layer_that_is_too_wide_is_refused() {
    FactorizedDensityConfig::new(1).with_filters(vec![3, 4]).init(&Device::flex());
}

#[test]
#[should_panic(expected = "a density has at most 4 hidden layers")]
fn too_many_layers_are_refused() {
    DensityShape::new(&[3; 5], true);
}
