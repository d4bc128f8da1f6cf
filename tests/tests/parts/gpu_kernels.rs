//! Kernels of the wgpu back end in cases that the other tests of back ends leave out: functions far into their tails,
//! lists that are longer than one launch can process, and a reading that fails.

use burn::tensor::{Device, Tensor, Transaction};
use light4gs_model::ops::activation::{bounded_exponential, sigmoid};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::ops::normal_likelihood::{NormalBounds, normal_likelihood};
use light4gs_model::ops::symbol_bits::{BelowBound, symbol_bits};
use light4gs_model::ops::uniform_noise::{NoiseDraw, add_uniform_noise};
use light4gs_model::{GpuError, HexPlaneConfig, PixelContribution, PlaneTensors, Significance, Splatter};
use light4gs_tests::odd_scenes::dots;

/// Values and gradient of a function, at places far into the tails and on both sides of the bound.
fn run(function: fn(Tensor<1>) -> Tensor<1>, device: Device, count: usize) -> [Vec<f32>; 2] {
    let device = device.autodiff();
    let places: Vec<f32> = (0..count).map(|i| i as f32 * 0.01 - 13.0).collect();
    let leaf = Tensor::<1>::from_floats(places.as_slice(), &device).require_grad();
    let values = function(leaf.clone());
    // Upstream gradients of both signs.
    let signs: Vec<f32> = (0..count).map(|i| [1.0, -0.5, 0.0][i % 3]).collect();
    let signs = Tensor::from_floats(signs.as_slice(), &device);
    let gradients = (values.clone() * signs).sum().backward();
    let gradient = leaf.grad(&gradients).expect("the leaf has a gradient");
    [values.into_data(), gradient.into_data()].map(|data| data.iter::<f32>().collect())
}

/// Under the standard normal distribution, with a bound that no place here reaches.
fn around_zero(places: Tensor<1>) -> Tensor<1> {
    let parameters = Tensor::cat(vec![places.ones_like(), places.zeros_like()], 0);
    normal_likelihood(places, parameters, NormalBounds { scale: 0.11, likelihood: 1e-37 })
}

#[test]
fn values_and_gradients_are_those_of_the_cpu() {
    type Function = fn(Tensor<1>) -> Tensor<1>;
    // Of values and slopes. Slopes of a likelihood and of the logistic function have a difference, whose rounding counts; that of
    // the exponential is ten times its value.
    let functions: [(&str, Function, [f32; 2]); 6] = [
        ("normal likelihood", around_zero, [f32::MIN_POSITIVE, f32::EPSILON]),
        ("lower bound", |x| lower_bound(x, 0.11), [0.0; 2]),
        ("symbol bits", |x| symbol_bits(x, 0.11, BelowBound::Rises), [1e-6, 0.0]),
        ("symbol bits of what stays", |x| symbol_bits(x, 0.11, BelowBound::Stays), [1e-6, 0.0]),
        ("sigmoid", sigmoid, [0.0, f32::EPSILON]),
        ("bounded exponential", |x| bounded_exponential(x * 10.0), [f32::MIN_POSITIVE, 10.0 * f32::MIN_POSITIVE]),
    ];
    for (what, function, rounding) in functions {
        for count in [0, 1, 2600] {
            let expected = run(function, Device::flex(), count);
            let found = run(function, Device::wgpu(Default::default()), count);
            for ((found, expected), rounding) in found.iter().zip(&expected).zip(rounding) {
                assert_eq!(found.len(), count);
                for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                    // At -13 the exponent is -84, and its rounding alone is a relative error of 4e-6. A GPU may take 0 for
                    // numbers below the smallest normal one.
                    let allowed = 1e-5 * expected.abs() + rounding;
                    assert!((found - expected).abs() <= allowed, "{what} {i}: {found} against {expected}");
                }
            }
        }
    }
}

/// No Gaussian, one Gaussian, and more Gaussians in one cell than one launch processes.
#[test]
fn scores_are_those_of_the_cpu() {
    for count in [0, 1, 40_000] {
        let run = |device: Device| {
            let (gaussians, camera) = dots(count, &device);
            let mut significance = Significance::new(count);
            significance.add(&Splatter::new([0.0; 3], 0), gaussians, &camera);
            significance
        };
        let (found, expected) = (run(Device::wgpu(Default::default())), run(Device::flex()));
        assert_eq!(found.sums(PixelContribution::PixelCount), vec![1.0; count]);
        for score in
            [PixelContribution::PixelCount, PixelContribution::BlendingWeight, PixelContribution::TransmittanceOpacity]
        {
            for (i, (found, expected)) in found.sums(score).iter().zip(expected.sums(score)).enumerate() {
                assert!(
                    (found - expected).abs() <= 1e-4 * expected,
                    "{score:?} of {i} in {count}: {found} against {expected}"
                );
            }
        }
    }
}

/// Far more points in one cell than the iterations that Mesa's software driver allows for a loop.
#[test]
fn a_crowded_cell() {
    const POINTS: usize = 20_000;
    let config = HexPlaneConfig { channels: 18, resolution: [4, 4, 4, 4], multipliers: vec![1] };
    // Once: tests beside this one draw from the same generator.
    let values = config.init(&Device::flex()).planes.into_iter().map(|plane| plane.val().into_data());
    let values: Vec<_> = values.collect();
    let gradients = |device: Device| {
        let device = device.autodiff();
        let planes = values.iter().map(|values| Tensor::from_data(values.clone(), &device).require_grad());
        let planes: Vec<Tensor<3>> = planes.collect();
        let points = Tensor::<2>::full([POINTS, 4], 0.1, &device);
        let features = PlaneTensors::new(config.layout(), planes.clone()).query(points);
        let gradients = features.sum().backward();
        let all = planes.iter().map(|plane| plane.grad(&gradients).expect("planes have gradients"));
        let sums = all.map(|gradient| gradient.sum().into_scalar::<f32>());
        sums.collect::<Vec<_>>()
    };
    let expected = gradients(Device::flex());
    let found = gradients(Device::wgpu(Default::default()));
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() <= 1e-3 * expected.abs(), "{found} against {expected}");
    }
}

/// The same noise everywhere, to the last bit of the noise itself.
#[test]
fn noise_is_that_of_the_cpu() {
    let run = |device: Device| -> Vec<f32> {
        let (widths, unit) = (Tensor::from_floats([0.25, 0.125], &device), Tensor::from_floats([4.0], &device));
        let draw = NoiseDraw { width: 1, in_units: true, seed: 1 << 40 | 3 };
        let noisy = add_uniform_noise(vec![Tensor::<1>::zeros([70_000], &device)], widths, unit, vec![draw]);
        noisy[0].clone().into_data().iter().collect()
    };
    assert_eq!(run(Device::wgpu(Default::default())), run(Device::flex()));
}

/// A tensor that no adapter can hold. Burn returns tensors, not results, so it is the reading that fails.
#[test]
fn a_reading_that_fails_is_an_error() {
    let device = Device::wgpu(Default::default());
    let read =
        |count: usize| GpuError::read("a test", Transaction::default().register(Tensor::<1>::ones([count], &device)));
    let error = read(1 << 40).unwrap_err();
    assert!(matches!(error, GpuError::Device { operation: "a test", .. }), "{error}");
    let after = read(2).expect("the device works on");
    assert_eq!(after[0].iter::<f32>().collect::<Vec<_>>(), [1.0; 2]);
}
