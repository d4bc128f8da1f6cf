//! Properties of the four entropy models of the spherical harmonics.

use burn::tensor::{Device, Distribution, Tensor, s};
use light4gs_model::{
    HexPlaneConfig, ShAutoregressiveConfig, ShBottleneckConfig, ShEntropy, ShEntropyConfig, ShEntropyModel,
    ShHexPlaneCoupledConfig, ShKnown, ShMixtureConfig,
};
use light4gs_tests::golden::{assert_close, devices, values_of};

const COUNT: usize = 50;
const STEP: f32 = 0.02;

fn models(device: &Device) -> Vec<(&'static str, ShEntropyModel)> {
    vec![
        ("factorised", ShEntropyConfig::Factorized(ShBottleneckConfig::new()).init(device)),
        ("mixture", ShEntropyConfig::Mixture(ShMixtureConfig::new()).init(device)),
        ("autoregressive", ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new()).init(device)),
        ("hexplane-coupled", ShEntropyConfig::HexPlaneCoupled(ShHexPlaneCoupledConfig::new(8)).init(device)),
    ]
}

fn random(shape: [usize; 3], device: &Device) -> Tensor<3> {
    Tensor::random(shape, Distribution::Normal(0.0, 0.1), device)
}

fn known(device: &Device) -> ShKnown {
    let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 12, 4, 8], ..Default::default() }.init(device);
    ShKnown {
        sh_dc: random([COUNT, 1, 3], device),
        positions: Tensor::random([COUNT, 3], Distribution::Uniform(-1.0, 1.0), device),
        planes: hexplane.tensors(),
    }
}

/// Every model gives finite bits and gradients, and less than half a step of error.
#[test]
fn bits_and_quantization() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let known = known(&device);
        for (model_name, model) in models(&device) {
            let values = random([COUNT, 15, 3], &device).require_grad();
            let found = model.bits(model.add_noise(values.clone()), &known);
            assert!(values_of(&found).iter().all(|bits| *bits >= 0.0 && *bits < 30.0), "{name} {model_name}");
            let gradient = values.grad(&found.sum().backward()).unwrap();
            let gradient = values_of(&gradient);
            assert!(
                gradient.iter().all(|g| g.is_finite()) && gradient.iter().any(|g| *g != 0.0),
                "{name} {model_name}"
            );

            let quantized = model.quantize(values.clone(), &known);
            let error = values_of(&(quantized - values).abs().max())[0];
            assert!(error < STEP / 2.0 + 1e-5, "{name} {model_name}: {error}");
        }
    }
}

/// The probabilities of a table are the likelihoods of the values that its symbols stand for, and their sum is one.
#[test]
fn tables_agree_with_bits() {
    let device = Device::flex();
    let known = known(&device);
    for (name, model) in models(&device) {
        let Some(tables) = model.tables() else { continue };
        let pmf = tables.pmf(-3..=3);
        let everything = tables.pmf(-5000..=5000);
        for symbol in -3i32..=3 {
            let values = Tensor::<3>::full([COUNT, 15, 3], symbol as f32 * STEP, &device);
            let found = values_of(&model.bits(values, &known).slice(s![0..1, .., ..]));
            let expected: Vec<f32> = pmf.iter().map(|pmf| -pmf[(symbol + 3) as usize].log2() as f32).collect();
            assert_close(name, &found, &expected, 2e-3);
        }
        let sums: Vec<f32> = everything.iter().map(|pmf| pmf.iter().sum::<f64>() as f32).collect();
        assert_close(name, &sums, &vec![1.0; sums.len()], 1e-3);
    }
}

/// The bits of a degree may depend on the lower degrees and on the degree itself, but not on the higher ones. The
/// values that the quantizer takes as decoded are those for which the rate is computed.
#[test]
fn a_degree_sees_only_lower_ones() {
    let device = Device::flex();
    let known = known(&device);
    let model = ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new()).init(&device);
    let values = random([COUNT, 15, 3], &device);
    let before = model.bits(values.clone(), &known);
    let changed = Tensor::cat(vec![values.clone().slice(s![.., 0..3, ..]), values.slice(s![.., 3..15, ..]) + 0.3], 1);
    let after = model.bits(changed, &known);
    let [first, second] = [&before, &after].map(|bits| values_of(&bits.clone().slice(s![.., 0..3, ..])));
    assert_eq!(first, second);
    assert_ne!(values_of(&before), values_of(&after));
}

/// The product of bilinear samples, at corners, where a sample is a cell.
#[test]
fn space_feature_at_corners() {
    for (name, device) in devices() {
        let known = known(&device);
        let corners = Tensor::<2>::from_floats([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]], &device);
        let found = values_of(&known.planes.query_space(corners));
        let cell = |plane: &Tensor<3>, channel: usize, across: bool, down: bool| {
            let [_, height, width] = plane.dims();
            let (row, column) = (if down { height - 1 } else { 0 }, if across { width - 1 } else { 0 });
            values_of(&plane.clone())[(channel * height + row) * width + column]
        };
        let mut expected = Vec::new();
        for [x, y, z] in [[false, false, false], [true, true, true], [true, false, true]] {
            for planes in known.planes.chunks_exact(6) {
                for channel in 0..4 {
                    let [xy, xz, yz] =
                        [(0, x, y), (1, x, z), (3, y, z)].map(|(p, a, b)| cell(&planes[p], channel, a, b));
                    expected.push(xy * xz * yz);
                }
            }
        }
        assert_close(name, &found, &expected, 1e-6);
    }
}
