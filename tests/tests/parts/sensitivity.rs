//! A Gaussian's sensitivity against images without it, on every back end.

use burn::tensor::{Device, Tensor};
use light4gs_data::Camera;
use light4gs_model::{GaussianTensors, Sensitivity, Splatter};
use light4gs_tests::golden::{assert_close_relative, devices};

const BACKGROUND: [f32; 3] = [1.0; 3];

/// Four Gaussians one behind the other, in a camera of 24×16 pixels.
fn scene(device: &Device) -> (GaussianTensors, Camera) {
    let gaussians = GaussianTensors {
        means: Tensor::from_floats([[0.0, 0.0, 0.0], [0.1, 0.2, 0.1], [0.0, 0.4, 0.0], [0.05, 3.0, 0.0]], device),
        log_scales: Tensor::full([4, 3], -1.5, device),
        quats: Tensor::from_floats([[1.0, 0.0, 0.0, 0.0]; 4], device),
        opacity_logits: Tensor::from_floats([[1.0], [0.0], [2.0], [1.5]], device),
        sh_dc: Tensor::from_floats(
            [[[0.9, -1.1, -0.8]], [[-0.6, 0.8, -1.0]], [[0.9, -1.1, -0.8]], [[-1.0, 0.2, 1.2]]],
            device,
        ),
        sh_rest: Tensor::zeros([4, 3, 3], device),
        further: Vec::new(),
    };
    let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 24, 16);
    (gaussians, camera)
}

fn sums(device: &Device, estimates: u64) -> Vec<f64> {
    let (gaussians, camera) = scene(device);
    let mut sensitivity = Sensitivity::new(4);
    (0..estimates).for_each(|seed| sensitivity.add(&Splatter::new(BACKGROUND, 0), gaussians.clone(), &camera, seed));
    sensitivity.sums().to_vec()
}

/// An estimate has a standard deviation of at most 1.4 times the sum, so the mean of 900 is within five times 4.7 %.
#[test]
fn it_is_the_squared_change_of_the_image_without_the_gaussian() {
    const ESTIMATES: u64 = 900;
    let (_, device) = devices().swap_remove(0);
    let (gaussians, camera) = scene(&device);
    let image = |gaussians| Splatter::new(BACKGROUND, 0).render(gaussians, &camera, None).image;
    let all = image(gaussians.clone());
    for (row, sum) in sums(&device, ESTIMATES).into_iter().enumerate() {
        let transparent = Tensor::from_floats([[-100.0]], &device);
        let logits = gaussians.opacity_logits.clone().slice_assign([row..row + 1, 0..1], transparent);
        let without = image(GaussianTensors { opacity_logits: logits, ..gaussians.clone() });
        let expected = f64::from((all.clone() - without).square().sum().into_scalar::<f32>());
        let found = sum / ESTIMATES as f64;
        assert!((found / expected - 1.0).abs() < 0.235, "{row}: {found} in place of {expected}");
    }
}

#[test]
fn back_ends_agree_on_it() {
    let of = |device: &Device| sums(device, 8).into_iter().map(|sum| sum as f32).collect::<Vec<_>>();
    let mut devices = devices().into_iter();
    let (first, device) = devices.next().expect("a back end");
    let expected = of(&device);
    for (name, device) in devices {
        assert_close_relative(&format!("{name} and {first}"), &of(&device), &expected, 1e-4);
    }
}

/// The second is behind the camera, the last has no opacity that is a number.
#[test]
fn what_is_not_drawn_has_none() {
    for (name, device) in devices() {
        let (mut gaussians, camera) = scene(&device);
        let behind = Tensor::from_floats([[0.0, -9.0, 0.0]], &device);
        gaussians.means = gaussians.means.slice_assign([1..2, 0..3], behind);
        let no_number = Tensor::from_floats([[f32::NAN]], &device);
        gaussians.opacity_logits = gaussians.opacity_logits.slice_assign([3..4, 0..1], no_number);
        let mut sensitivity = Sensitivity::new(4);
        sensitivity.add(&Splatter::new(BACKGROUND, 0), gaussians, &camera, 7);
        let sums = sensitivity.sums();
        assert!(sums[0] > 0.0 && sums[2] > 0.0, "{name}: {sums:?}");
        assert_eq!([sums[1], sums[3]], [0.0; 2], "{name}");
    }
}
