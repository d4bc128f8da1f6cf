//! Gaussians before a backdrop are drawn as in one scene with it, and the backdrop gets no gradient, on every back end.

use burn::tensor::{Device, Int, Tensor};
use light4gs_codec::GaussianArrays;
use light4gs_codec::take::{SegmentPart, drawn_together};
use light4gs_data::{Camera, PointCloud};
use light4gs_model::{Backdrop, Gaussians, GaussiansConfig, PixelContribution, Rendering, Significance, Splatter};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};

const BACKGROUND: [f32; 3] = [0.2, 0.4, 0.9];

fn camera() -> Camera {
    Camera::look_at([0.0, -4.0, 0.3].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30)
}

/// A few colored Gaussians of a degree around a place.
fn some(count: usize, seed: u64, depth: f32, degree: usize) -> GaussianArrays {
    let mut cloud = PointCloud::random(count, 0.6, seed);
    cloud.positions.iter_mut().for_each(|place| place[1] += depth);
    let config = GaussiansConfig::new().with_sh_degree(degree).with_opacity(0.6);
    let mut arrays = config.init(&cloud, &Device::flex()).to_arrays();
    arrays.sh_rest.iter_mut().enumerate().for_each(|(k, value)| *value = 0.1 * (k as f32).sin());
    arrays
}

/// One after the other, at the higher of the two degrees.
fn together(own: &GaussianArrays, still: &GaussianArrays) -> GaussianArrays {
    let part = SegmentPart { hidden: &[], moved: still, weight: 1.0 };
    drawn_together(own, &[part])
}

fn radii(rendering: &Rendering) -> Vec<i32> {
    let radii: Tensor<1, Int> = rendering.radii.clone();
    radii.into_data().iter().collect()
}

#[test]
fn the_image_and_the_gradients_are_those_of_one_scene() {
    for (own_degree, still_degree) in [(0, 0), (1, 1), (0, 2), (2, 0)] {
        let (own, still) = (some(30, 1, -0.3, own_degree), some(40, 2, 0.3, still_degree));
        let all = together(&own, &still);
        let degree = own_degree.max(still_degree);
        for (name, device) in devices() {
            let device = device.autodiff();
            let parameters = |arrays: &GaussianArrays| Gaussians::from_arrays(arrays, &device).tensors();
            let leaf = |tensor: &Tensor<2>| Tensor::<2>::from_inner(tensor.clone().inner()).require_grad();
            let mut before = parameters(&own);
            before.means = leaf(&before.means);
            let means = before.means.clone();
            let backdrop = Backdrop::new(&still, &device);
            let splatter = Splatter::new(BACKGROUND, own_degree).with_backdrop(Some(backdrop));
            let drawn = splatter.render(before, &camera(), None);

            let mut whole = parameters(&all);
            whole.means = leaf(&whole.means);
            let all_means = whole.means.clone();
            let expected = Splatter::new(BACKGROUND, degree).render(whole, &camera(), None);

            assert_eq!(
                values_of(&drawn.image),
                values_of(&expected.image),
                "{name}, degrees {own_degree}, {still_degree}"
            );
            assert_eq!(radii(&drawn), radii(&expected)[..own.len()], "{name}");
            let gradient = means.grad(&drawn.image.sum().backward()).expect("a gradient");
            let of_all = all_means.grad(&expected.image.sum().backward()).expect("a gradient");
            let found = values_of(&gradient);
            assert_close_relative(name, &found, &values_of(&of_all)[..found.len()], 1e-5);
            assert!(found.iter().any(|slope| *slope != 0.0));
        }
    }
}

#[test]
fn significance_is_that_of_what_is_before() {
    let (own, still) = (some(30, 1, 0.3, 0), some(40, 2, -0.3, 0));
    for (name, device) in devices() {
        let tensors = |arrays: &GaussianArrays| Gaussians::from_arrays(arrays, &device).tensors();
        let sums = |splatter: &Splatter, arrays: &GaussianArrays| {
            let mut significance = Significance::new(arrays.len());
            significance.add(splatter, tensors(arrays), &camera());
            significance.sums(PixelContribution::BlendingWeight)
        };
        let alone = Splatter::new(BACKGROUND, 0);
        let before = alone.clone().with_backdrop(Some(Backdrop::new(&still, &device)));
        let (hidden, expected) = (sums(&before, &own), sums(&alone, &together(&own, &still)));
        assert_eq!(hidden, expected[..own.len()], "{name}");
        assert!(hidden.iter().sum::<f64>() < sums(&alone, &own).iter().sum::<f64>(), "{name}: the backdrop hides");
    }
}
