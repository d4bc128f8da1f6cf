//! Scenes that nobody would make on purpose: Gaussians that can only just be drawn, and Gaussians that cannot.

use burn::tensor::{Device, Tensor, TensorData};
use glam::Vec3;
use light4gs_data::Camera;
use light4gs_model::GaussianTensors;

use crate::random::Random;
use crate::splat_scene::{ATTRIBUTES, MEANS, OPACITIES, QUATS, SCALES, SH_DC, SplatScene, WIDTHS, image_of};

/// Background of the images.
pub const BACKGROUND: [f32; 3] = [0.1, 0.6, 1.0];
/// Widths and heights, most of them no multiples of a tile.
pub const SIZES: [[u32; 2]; 6] = [[1, 1], [17, 31], [40, 30], [16, 16], [64, 3], [33, 48]];

/// The results of a rendering and its backward pass.
pub struct Run {
    /// `[H, W, 5]`.
    pub image: Vec<f32>,
    /// `[N]`.
    pub radii: Vec<i64>,
    /// Number of Gaussians that could not be drawn.
    pub invalid: usize,
    /// Gradients of the sum of the image times random weights, with respect to the seven inputs.
    pub gradients: [Vec<f32>; 7],
}

/// Renders, and computes gradients with a random weight for each pixel and channel.
pub fn run(scene: &SplatScene, camera: &Camera, degree: usize, device: &Device) -> Run {
    let weights = Random::new(99).normals((camera.width * camera.height * 5) as usize);
    run_weighed(scene, camera, degree, device, &weights)
}

/// [`run`] with other weights `[H, W, 5]`.
pub fn run_weighed(scene: &SplatScene, camera: &Camera, degree: usize, device: &Device, weights: &[f64]) -> Run {
    let leaves = scene.leaves(&device.clone().autodiff());
    let rendering = leaves.render(camera, BACKGROUND, degree);
    let image = image_of(&rendering);
    let radii = rendering.radii.to_data().iter::<i64>().collect();
    let invalid = rendering.invalid_count();
    Run { image, radii, invalid, gradients: leaves.gradients(rendering, weights) }
}

/// A point `depth` in front of the camera, `x` and `y` in half fields of view off its axis.
pub fn point_in_view(camera: &Camera, x: f32, y: f32, depth: f32) -> [f64; 3] {
    let (tan_x, tan_y) = (camera.width as f32 / (2.0 * camera.fx), camera.height as f32 / (2.0 * camera.fy));
    let view = glam::Vec3::new(x * tan_x, y * tan_y, 1.0) * depth;
    (camera.rotation.transpose() * (view - camera.translation)).to_array().map(f64::from)
}

/// Makes a Gaussian odd, but leaves it valid.
pub fn make_odd(scene: &mut SplatScene, i: usize, camera: &Camera, random: &mut Random) {
    let side = random.uniform(-1.0, 1.0) as f32;
    match random.below(12) {
        0 => scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(camera, side, -side, -3.0)),
        1 => scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(camera, 40.0 * side, 9.0, 3.0)),
        2 => scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(camera, side, side, 0.201)),
        3 => scene.row_mut(MEANS, i).copy_from_slice(&camera.center().to_array().map(f64::from)),
        4 => scene.row_mut(SCALES, i).fill(50.0),
        5 => scene.row_mut(SCALES, i).fill(1e-12),
        6 => scene.row_mut(SCALES, i).fill(0.0),
        7 => scene.row_mut(SCALES, i)[1] = 20.0,
        8 => scene.row_mut(OPACITIES, i)[0] = 0.0,
        9 => scene.row_mut(OPACITIES, i)[0] = 1.0,
        10 => scene.row_mut(QUATS, i).iter_mut().for_each(|q| *q = f64::from((*q * 1e-6) as f32)),
        _ => scene.row_mut(SH_DC, i).fill(-30.0),
    }
}

/// Makes a Gaussian impossible to draw, at a place in the image. Returns the name of the change.
pub fn poison(scene: &mut SplatScene, i: usize, camera: &Camera, random: &mut Random) -> String {
    let place = point_in_view(camera, random.uniform(-0.8, 0.8) as f32, random.uniform(-0.8, 0.8) as f32, 3.0);
    scene.row_mut(MEANS, i).copy_from_slice(&place);
    scene.row_mut(OPACITIES, i)[0] = 0.9;
    let attribute = random.below(ATTRIBUTES.len() + 1);
    if attribute == ATTRIBUTES.len() {
        scene.row_mut(QUATS, i).fill(0.0);
        return "zero quaternion".to_owned();
    }
    let value = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][random.below(3)];
    let component = random.below(WIDTHS[attribute]);
    scene.row_mut(attribute, i)[component] = value;
    format!("{value} in {}[{component}]", ATTRIBUTES[attribute])
}

/// Side of the image of [`dots`], one cell.
const SIDE: u32 = 8;

/// Faint dots, each in the middle of one pixel of an image that is one cell, no two at one depth: no result depends on
/// the last bit.
pub fn dots(count: usize, device: &Device) -> (GaussianTensors, Camera) {
    let camera = Camera::look_at(Vec3::new(0.3, -4.0, 0.5), Vec3::ZERO, Vec3::Z, 0.7, SIDE, SIDE);
    let place = |i: usize| {
        let pixel = i as u32 % (SIDE * SIDE);
        let across = ((pixel % SIDE) as f32 + 0.5 - camera.cx) / camera.fx;
        let down = ((pixel / SIDE) as f32 + 0.5 - camera.cy) / camera.fy;
        let depth = 2.0 + 1e-4 * i as f32;
        (camera.rotation.transpose() * (Vec3::new(across, down, 1.0) * depth - camera.translation)).to_array()
    };
    let means: Vec<f32> = (0..count).flat_map(place).collect();
    let quats = [1.0, 0.0, 0.0, 0.0].repeat(count);
    let gaussians = GaussianTensors {
        means: Tensor::from_data(TensorData::new(means, [count, 3]), device),
        quats: Tensor::from_data(TensorData::new(quats, [count, 4]), device),
        log_scales: Tensor::full([count, 3], -7.0, device),
        // An alpha of 0.0055: above 1/255 in its pixel, below it in the next.
        opacity_logits: Tensor::full([count, 1], -5.2, device),
        sh_dc: Tensor::zeros([count, 1, 3], device),
        sh_rest: Tensor::zeros([count, 15, 3], device),
        further: Vec::new(),
    };
    (gaussians, camera)
}
