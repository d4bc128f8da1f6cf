//! Bits of attributes against plain operations of Burn and their derivatives, and against differences of a plain float64 twin,
//! which shares no code with the operation.

use burn::module::{Param, ParamId};
use burn::tensor::{Device, Int, Tensor, TensorData};
use light4gs_model::LogisticMixtureConfig;
use light4gs_model::ops::attribute_bits::{
    AttributeBitsInputs, AttributeChannels, CountedBits, MOST_COMPONENTS, PositionSet, attribute_bits,
    prediction_inputs,
};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_tests::golden::{assert_close, assert_close_relative, cpu_devices, devices, values_of};
use light4gs_tests::random::Random;

/// The differentiable inputs, in the order of [`Case::inputs`].
const INPUTS: [&str; 6] = ["numbers", "prediction", "log_steps", "weight_logits", "means", "log_scales"];
const NUMBERS: usize = 0;
const LOG_STEPS: usize = 2;
const MEANS: usize = 4;
const LOG_SCALES: usize = 5;
const BOUND: f32 = 1e-9;

#[derive(Clone)]
struct Case {
    counted: CountedBits,
    channels: usize,
    /// Row by row.
    inputs: [Vec<f64>; 6],
    factors: Vec<f32>,
}

impl Case {
    /// Numbers near their predictions and far from them, steps narrow and wide. The attributes have these numbers of channels; the
    /// step of the positions comes first, those of the attributes follow in the opposite order.
    fn random(widths: &[usize], count: usize, components: usize, random: &mut Random) -> Self {
        let channels = widths.iter().sum::<usize>();
        let mut first = 0;
        let attributes = widths.iter().enumerate().map(|(k, width)| {
            first += width;
            AttributeChannels { channels: first - width..first, place: widths.len() - k }
        });
        let counted = CountedBits {
            attributes: attributes.collect(),
            positions: Some(PositionSet { place: 0, extent: [3.0, 0.2, 40.0], count: 50, coded: None }),
            bound: BOUND,
            share: 3.0,
            weight: 0.5,
        };
        let mut uniform = |count: usize, low: f64, high: f64| -> Vec<f64> {
            (0..count).map(|_| f64::from(random.uniform(low, high) as f32)).collect()
        };
        let inputs = [
            uniform(3 * channels * count, -1.0, 1.0),
            uniform(channels * 3 * channels, -0.3, 0.3),
            uniform(widths.len() + 1, -4.0, -1.0),
            uniform(channels * components, -1.0, 1.0),
            uniform(channels * components, -0.5, 0.5),
            uniform(channels * components, -3.0, 0.0),
        ];
        let factors = uniform(widths.len() + 1, 0.5, 1.5).into_iter().map(|factor| factor as f32).collect();
        Self { counted, channels, inputs, factors }
    }

    /// Gaussians.
    fn count(&self) -> usize {
        self.inputs[NUMBERS].len() / (3 * self.channels)
    }

    /// The attribute of each channel.
    fn by_channel(&self) -> impl Iterator<Item = (usize, &AttributeChannels)> {
        let attributes = self.counted.attributes.iter();
        attributes.flat_map(|attribute| attribute.channels.clone().map(move |channel| (channel, attribute)))
    }

    /// Bits, and gradients of their sum with `weights`.
    fn run(
        &self,
        device: &Device,
        weights: &[f32],
        operation: impl Fn(AttributeBitsInputs, &Self) -> Tensor<1>,
    ) -> (Vec<f32>, [Vec<f32>; 6]) {
        let device = device.clone().autodiff();
        let rows = [3 * self.channels, self.channels, 1, self.channels, self.channels, self.channels];
        let leaves: [Tensor<2>; 6] = std::array::from_fn(|k| {
            let values: Vec<f32> = self.inputs[k].iter().map(|value| *value as f32).collect();
            let shape = [rows[k], values.len() / rows[k]];
            Tensor::from_data(TensorData::new(values, shape), &device).require_grad()
        });
        let [numbers, prediction, log_steps, weight_logits, means, log_scales] = leaves.clone();
        let inputs = AttributeBitsInputs {
            numbers,
            prediction,
            log_steps: log_steps.flatten(0, 1),
            weight_logits,
            means,
            log_scales,
            factors: Tensor::from_floats(self.factors.as_slice(), &device),
        };
        let bits = operation(inputs, self);
        let gradients = (bits.clone() * Tensor::from_floats(weights, &device)).sum().backward();
        (values_of(&bits), leaves.map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient"))))
    }

    /// Bits of the positions and of each channel in float64.
    fn twin(&self) -> Vec<f64> {
        let [numbers, prediction, log_steps, weight_logits, means, log_scales] = &self.inputs;
        let (channels, count) = (self.channels, self.count());
        let components = means.len() / channels;
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let likelihood = |channel: usize, width: f64, value: f64| {
            let own = channel * components..(channel + 1) * components;
            let total: f64 = weight_logits[own.clone()].iter().map(|logit| logit.exp()).sum();
            let mass = |k: usize| {
                // On the side where the logistic function is small.
                let distance = -(value - means[k]).abs();
                let edge = |side: f64| sigmoid((distance + side * width) / log_scales[k].exp());
                weight_logits[k].exp() / total * (edge(0.5) - edge(-0.5))
            };
            own.map(mass).sum::<f64>()
        };
        let CountedBits { share, weight, positions, .. } = &self.counted;
        let (share, weight) = (f64::from(*share), f64::from(*weight));
        let of_channels = self.by_channel().map(|(channel, attribute)| {
            let first = attribute.channels.start;
            let bits = |m: usize| {
                let number = |row: usize| numbers[row * count + m];
                let weighted = |row: usize| prediction[channel * 3 * channels + row] * number(row);
                let own: f64 = (first..channel).map(weighted).sum();
                let around: f64 = (first..channel + 1).map(|near| weighted(channels + near)).sum();
                let residual = number(channel) - own - around - weighted(2 * channels + channel);
                -likelihood(channel, log_steps[attribute.place].exp(), residual).max(f64::from(BOUND)).log2()
            };
            let factor = f64::from(self.factors[attribute.place]);
            (0..count).map(bits).sum::<f64>() * factor * share * weight
        });
        let of_positions = positions.as_ref().map_or(0.0, |positions| {
            let step = log_steps[positions.place].exp();
            let count = positions.count as f64;
            let cells: f64 = positions.extent.iter().map(|extent| (f64::from(*extent) / step + 1.0).log2()).sum();
            (count * cells - count * (count.log2() - std::f64::consts::LOG2_E)) * weight
        });
        std::iter::once(of_positions).chain(of_channels).collect()
    }
}

/// The operation in plain ones.
fn plain(inputs: AttributeBitsInputs, case: &Case) -> Tensor<1> {
    let AttributeBitsInputs { numbers, prediction, log_steps, weight_logits, means, log_scales, factors } = inputs;
    let ([channels, components], device) = (means.dims(), numbers.device());
    let mut used = vec![0.0; channels * 3 * channels];
    let mut places = Vec::new();
    for (channel, attribute) in case.by_channel() {
        let rows = prediction_inputs(attribute.channels.start, channel, channels);
        rows.for_each(|row| used[channel * 3 * channels + row] = 1.0);
        places.push(attribute.place as i64);
    }
    let used = Tensor::<1>::from_floats(used.as_slice(), &device).reshape([channels, 3 * channels]);
    let places = Tensor::<1, Int>::from_data(TensorData::from(places.as_slice()), &device);
    let residuals = numbers.clone().narrow(0, 0, channels) - (prediction * used).matmul(numbers);
    let widths = log_steps.clone().exp().select(0, places.clone()).unsqueeze_dim::<2>(1);
    let mut mixture = LogisticMixtureConfig::new(channels).with_components(components).init(&device);
    let put = |value: Tensor<2>| Param::initialized(ParamId::new(), value);
    mixture.weight_logits = put(weight_logits);
    mixture.means = put(means);
    mixture.log_scales = put(log_scales);
    let likelihood = lower_bound(mixture.interval_likelihood(residuals, widths), BOUND);
    let CountedBits { share, weight, positions, .. } = &case.counted;
    let of_channels = (likelihood.log() * -std::f64::consts::LOG2_E).sum_dim(1).squeeze_dim::<1>(1);
    let of_channels = of_channels * factors.select(0, places) * (*share * *weight);
    let positions = positions.as_ref().expect("the cases have positions");
    let extent = Tensor::<1>::from_floats(positions.extent, &device);
    let cells = (extent / log_steps.narrow(0, positions.place, 1).exp() + 1.0).log().sum();
    let count = positions.count as f64;
    let order = count * (count.log2() - std::f64::consts::LOG2_E);
    let of_positions = (cells * (count * std::f64::consts::LOG2_E) - order) * *weight;
    Tensor::cat(vec![of_positions, of_channels], 0)
}

fn fused(inputs: AttributeBitsInputs, case: &Case) -> Tensor<1> {
    attribute_bits(inputs, case.counted.clone())
}

/// Channels of the attributes, and the number of Gaussians.
const SIZES: [(&[usize], usize); 5] = [(&[1], 1), (&[3], 8), (&[2, 1], 63), (&[3, 4, 1, 3, 15], 500), (&[1, 4], 3001)];

fn cases() -> impl Iterator<Item = (String, Case, Vec<f32>)> {
    SIZES.into_iter().enumerate().flat_map(|(seed, (widths, count))| {
        (1..=MOST_COMPONENTS).map(move |components| {
            let mut random = Random::new(600 + seed as u64);
            let case = Case::random(widths, count, components, &mut random);
            // Some channels shall have more bits.
            let weights = random.normals(1 + case.channels).iter().map(|weight| *weight as f32).collect();
            (format!("attributes of {widths:?} channels, {count} Gaussians, {components} logistics"), case, weights)
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
    for [width, log_scales] in [[0.01f64, -2.0], [1e-4, 0.0], [0.5, -3.0], [0.05, -3.0]] {
        let mut case = Case::random(&[2], 21, 3, &mut random);
        case.inputs[LOG_STEPS].fill(width.ln());
        case.inputs[LOG_SCALES].fill(log_scales);
        // So near that no likelihood is below the bound, where the derivative is not that of the value.
        case.inputs[NUMBERS].iter_mut().for_each(|value| *value *= log_scales.exp());
        case.inputs[MEANS].iter_mut().for_each(|mean| *mean *= log_scales.exp());
        let expected = case.twin();
        let weights = [0.1, 1.0, -0.5];
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
            let what = format!("{name}, width {width}, scales e^{log_scales}");
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

/// Two attributes of a channel each that nothing is predicted from, and no positions.
fn without_predictions(numbers: Vec<f64>) -> Case {
    let count = numbers.len() / 2;
    let mut case = Case::random(&[1, 1], count, 1, &mut Random::new(650));
    case.counted = CountedBits { positions: None, share: 1.0, weight: 1.0, ..case.counted };
    let nothing = vec![0.0; 4 * count];
    case.inputs =
        [[numbers, nothing].concat(), vec![0.0; 12], vec![0.1f64.ln(); 3], vec![0.0; 2], vec![0.0; 2], vec![-2.0; 2]];
    case.factors.fill(1.0);
    case
}

/// Below the bound a gradient passes only where a step along it would raise the likelihood.
#[test]
fn far_values_come_back() {
    let case = without_predictions(vec![0.1, 9.0, 0.1, 9.0]);
    for (name, device) in devices() {
        let (bits, gradients) = case.run(&device, &[1.0, 1.0, -1.0], fused);
        assert!(bits[0] == 0.0 && (bits[1] - bits[2]).abs() < 1e-5 && bits[1] > 29.8, "{name}: {bits:?}");
        let of_numbers = &gradients[NUMBERS];
        assert!(of_numbers[1].abs() < 1e-3, "{name}: the mass there has no slope: {of_numbers:?}");
        assert!(of_numbers[0] > 0.1 && of_numbers[2] < -0.1 && of_numbers[3] == 0.0, "{name}: {of_numbers:?}");
    }
}

/// The bits of positions in a file are a number; their derivative is that of a set of points.
#[test]
fn coded_positions_keep_the_slope() {
    let mut case = Case::random(&[2], 5, 2, &mut Random::new(660));
    let weights = [1.0, 0.0, 0.0];
    for (name, device) in devices() {
        let (_, slopes) = case.run(&device, &weights, fused);
        let mut coded = case.clone();
        coded.counted.positions.as_mut().expect("the case has positions").coded = Some(777);
        let (bits, gradients) = coded.run(&device, &weights, fused);
        assert_eq!(bits[0], 777.0 * case.counted.weight, "{name}");
        assert!(slopes[LOG_STEPS][0] < 0.0 && gradients[LOG_STEPS] == slopes[LOG_STEPS], "{name}: {gradients:?}");
    }
    case.counted.positions = None;
    let (bits, gradients) = case.run(&Device::flex(), &weights, fused);
    assert!(bits[0] == 0.0 && gradients[LOG_STEPS][0] == 0.0);
}

#[test]
fn what_is_not_a_number_stays_so() {
    let mut numbers = vec![0.1; 18];
    numbers[3] = f64::NAN;
    // WGSL promises nothing about them.
    for (name, device) in cpu_devices() {
        let (bits, _) = without_predictions(numbers.clone()).run(&device, &[1.0; 3], fused);
        assert!(bits[1].is_nan(), "{name}: {bits:?}");
    }
}

#[test]
fn no_values_have_no_bits() {
    for (name, device) in devices() {
        let (bits, gradients) = without_predictions(Vec::new()).run(&device, &[1.0; 3], fused);
        assert_eq!(bits, [0.0; 3], "{name}");
        assert!(gradients.iter().flatten().all(|gradient| *gradient == 0.0), "{name}: {gradients:?}");
    }
}
