//! The mean difference of two images against plain operations.

use burn::tensor::{Device, Tensor};
use light4gs_model::ops::image_difference::{Difference, mean_difference};
use light4gs_tests::golden::{devices, values_of};
use light4gs_tests::random::Random;

/// Less than a block of the kernels, some blocks, and no whole number of them.
const SIZES: [[usize; 2]; 3] = [[1, 1], [40, 50], [211, 307]];

fn image(random: &mut Random, [height, width]: [usize; 2], device: &Device) -> Tensor<3> {
    let values: Vec<f32> = (0..3 * height * width).map(|_| random.uniform(0.0, 1.0) as f32).collect();
    Tensor::<1>::from_floats(values.as_slice(), device).reshape([height, width, 3])
}

#[test]
fn means_and_gradients_are_those_of_plain_operations() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for size in SIZES {
            for difference in [Difference::Absolute, Difference::Squared] {
                let mut random = Random::new(70);
                let truth = image(&mut random, size, &device);
                // The first row is the same in both.
                let shown = image(&mut random, size, &device);
                let shown = shown.slice_assign([0..1, 0..size[1], 0..3], truth.clone().slice([0..1, 0..size[1], 0..3]));
                let run = |mean: &dyn Fn(Tensor<3>) -> Tensor<1>| {
                    let leaf = shown.clone().detach().require_grad();
                    let mean = mean(leaf.clone());
                    let gradient = leaf.grad(&(mean.clone() * 3.0).backward()).expect("the leaf has a gradient");
                    (values_of(&mean)[0], values_of(&gradient))
                };
                let (mean, gradient) = run(&|image| mean_difference(difference, image, truth.clone()));
                let (expected, of_plain) = run(&|image| match difference {
                    Difference::Absolute => (image - truth.clone()).abs().mean(),
                    Difference::Squared => (image - truth.clone()).powi_scalar(2).mean(),
                });
                let what = format!("{name}, {size:?}, {difference:?}");
                assert!((mean - expected).abs() <= 1e-5 * expected, "{what}: {mean} against {expected}");
                for (found, expected) in gradient.iter().zip(&of_plain) {
                    assert!((found - expected).abs() <= 1e-6 * expected.abs(), "{what}: {found} against {expected}");
                }
                assert_eq!(gradient[0], 0.0, "{what}: no difference");
            }
        }
    }
}

#[test]
fn what_is_not_a_number_is_no_loss_of_zero() {
    for (name, device) in devices() {
        for difference in [Difference::Absolute, Difference::Squared] {
            let image = Tensor::<1>::from_floats([0.5, f32::NAN, 0.25], &device);
            let mean = mean_difference(difference, image, Tensor::zeros([3], &device));
            assert!(values_of(&mean)[0].is_nan(), "{name}, {difference:?}");
        }
    }
}
