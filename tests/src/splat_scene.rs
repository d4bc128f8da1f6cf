//! Plain arrays of activated Gaussians: for random scenes, and as the input of both the operation and its float64 twin.

use burn::tensor::{Device, Tensor, TensorData, s};
use glam::{Mat3, Quat, Vec2, Vec3};
use light4gs_data::Camera;
use light4gs_model::{ActivatedGaussians, Rendering, Splatter};

use crate::golden::values_of;
use crate::random::Random;

/// Names of the seven differentiable inputs, in the order of [`SplatScene::attributes`].
pub const ATTRIBUTES: [&str; 7] = ["means", "quats", "scales", "opacities", "sh_dc", "sh_rest", "screen_offsets"];
/// Number of values of each input per Gaussian.
pub const WIDTHS: [usize; 7] = [3, 4, 3, 1, 3, 45, 2];
/// Position of the means in [`ATTRIBUTES`].
pub const MEANS: usize = 0;
/// Position of the quaternions.
pub const QUATS: usize = 1;
/// Position of the standard deviations.
pub const SCALES: usize = 2;
/// Position of the opacities.
pub const OPACITIES: usize = 3;
/// Position of the degree-0 harmonics.
pub const SH_DC: usize = 4;
/// Position of the higher harmonics.
pub const SH_REST: usize = 5;
/// Position of the screen offsets.
pub const SCREEN_OFFSETS: usize = 6;

/// Activated attributes of N Gaussians, row-major, of degree 3.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplatScene {
    /// `[N, WIDTHS[k]]` each.
    pub attributes: [Vec<f64>; 7],
}

/// The ranges from which a random Gaussian is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Ranges {
    /// Half the side of the cube around the origin that the means are in.
    pub half_size: f64,
    /// Standard deviations.
    pub scales: [f64; 2],
    /// Opacities.
    pub opacities: [f64; 2],
    /// Standard deviation of the harmonics of degree 0 and of the higher ones.
    pub sh: [f64; 2],
    /// Largest screen offset, half images.
    pub offset: f64,
}

impl Default for Ranges {
    fn default() -> Self {
        Self { half_size: 1.3, scales: [0.03, 0.3], opacities: [0.02, 1.0], sh: [0.8, 0.2], offset: 0.02 }
    }
}

impl SplatScene {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.attributes[OPACITIES].len()
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds one random Gaussian.
    pub fn push_random(&mut self, ranges: &Ranges, random: &mut Random) {
        let r = random;
        let [means, quats, scales, opacities, sh_dc, sh_rest, offsets] = &mut self.attributes;
        means.extend([0; 3].map(|_| r.uniform(-ranges.half_size, ranges.half_size)));
        quats.extend([0; 4].map(|_| r.normal()));
        // Uniform in the logarithm.
        let [low, high] = ranges.scales.map(f64::ln);
        scales.extend([0; 3].map(|_| f64::from(r.uniform(low, high).exp() as f32)));
        opacities.push(r.uniform(ranges.opacities[0], ranges.opacities[1]));
        sh_dc.extend([0; 3].map(|_| f64::from((0.8 + ranges.sh[0] * r.normal()) as f32)));
        sh_rest.extend([0; 45].map(|_| f64::from((ranges.sh[1] * r.normal()) as f32)));
        offsets.extend([0; 2].map(|_| r.uniform(-1.0, 1.0) * ranges.offset).map(|v| f64::from(v as f32)));
    }

    /// Random Gaussians.
    pub fn random(count: usize, ranges: &Ranges, random: &mut Random) -> Self {
        let mut scene = Self::default();
        (0..count).for_each(|_| scene.push_random(ranges, random));
        scene
    }

    /// Values of one attribute of one Gaussian.
    pub fn row_mut(&mut self, attribute: usize, gaussian: usize) -> &mut [f64] {
        let width = WIDTHS[attribute];
        &mut self.attributes[attribute][gaussian * width..(gaussian + 1) * width]
    }

    /// The Gaussians for which `keep` is set, in their order.
    pub fn filtered(&self, keep: &[bool]) -> Self {
        let mut attributes: [Vec<f64>; 7] = Default::default();
        for (k, values) in self.attributes.iter().enumerate() {
            let rows = values.chunks_exact(WIDTHS[k]).zip(keep).filter(|(_, keep)| **keep);
            attributes[k] = rows.flat_map(|(row, _)| row.iter().copied()).collect();
        }
        Self { attributes }
    }

    /// Leaves of the tape.
    pub fn leaves(&self, device: &Device) -> SceneLeaves {
        let tensors = std::array::from_fn(|k| {
            let values: Vec<f32> = self.attributes[k].iter().map(|v| *v as f32).collect();
            Tensor::from_data(TensorData::new(values, [self.len(), WIDTHS[k]]), device).require_grad()
        });
        SceneLeaves { tensors }
    }
}

/// [`SplatScene::attributes`] on a device with autodiff, `[N, WIDTHS[k]]` each.
pub struct SceneLeaves {
    /// In the order of [`ATTRIBUTES`].
    pub tensors: [Tensor<2>; 7],
}

impl SceneLeaves {
    /// Renders with the operation.
    pub fn render(&self, camera: &Camera, background: [f32; 3], degree: usize) -> Rendering {
        let [means, quats, scales, opacities, sh_dc, sh_rest, offsets] = self.tensors.clone();
        let count = means.dims()[0];
        let (sh_dc, sh_rest) = (sh_dc.reshape([count, 1, 3]), sh_rest.reshape([count, 15, 3]));
        let gaussians = ActivatedGaussians { means, quats, scales, opacities, sh_dc, sh_rest };
        Splatter::new(background, degree).render_activated(gaussians, camera, Some(offsets))
    }

    /// Gradients of `sum(image · weights)`, `weights [H, W, 5]`, by all seven inputs.
    pub fn gradients(&self, rendering: Rendering, weights: &[f64]) -> [Vec<f32>; 7] {
        let [height, width, _] = rendering.image.dims();
        let values: Vec<f32> = weights.iter().map(|w| *w as f32).collect();
        let device = rendering.image.device();
        let weights = Tensor::<3>::from_data(TensorData::new(values, [height, width, 5]), &device);
        let channel = |c: usize| weights.clone().slice(s![.., .., c..c + 1]).squeeze_dim::<2>(2);
        let loss = (rendering.image * weights.clone().slice(s![.., .., 0..3])).sum()
            + (rendering.alpha * channel(3)).sum()
            + (rendering.depth * channel(4)).sum();
        let grads = loss.backward();
        self.tensors.each_ref().map(|leaf| values_of(&leaf.grad(&grads).expect("every input has a gradient")))
    }
}

/// `[H, W, 5]`: red, green, blue, alpha, depth of a rendering.
pub fn image_of(rendering: &Rendering) -> Vec<f32> {
    let (image, alpha, depth) = (values_of(&rendering.image), values_of(&rendering.alpha), values_of(&rendering.depth));
    let pixels = image.chunks_exact(3).zip(alpha).zip(depth);
    pixels.flat_map(|((rgb, alpha), depth)| [rgb[0], rgb[1], rgb[2], alpha, depth]).collect()
}

/// The camera with its principal point moved to `share` of the image's width and height, and turned so that the middle of
/// its image stays there.
pub fn with_principal_point(camera: &Camera, share: [f32; 2]) -> Camera {
    let size = Vec2::new(camera.width as f32, camera.height as f32);
    let point = size * Vec2::from_array(share);
    let middle = ((0.5 * size - point) / Vec2::new(camera.fx, camera.fy)).extend(1.0).normalize();
    let turn = Mat3::from_quat(Quat::from_rotation_arc(Vec3::Z, middle));
    Camera {
        rotation: turn * camera.rotation,
        translation: turn * camera.translation,
        cx: point.x,
        cy: point.y,
        ..*camera
    }
}

/// A camera around the origin, at a distance of about 4, with its principal point off the center and unequal focal
/// lengths.
pub fn random_camera(width: u32, height: u32, random: &mut Random) -> Camera {
    let direction = Vec3::from_array([0; 3].map(|_| random.normal() as f32)).normalize();
    let eye = direction * random.uniform(3.5, 4.5) as f32;
    let target = Vec3::from_array([0; 3].map(|_| random.uniform(-0.2, 0.2) as f32));
    let mut camera = Camera::look_at(eye, target, Vec3::new(0.1, 0.2, 1.0), 0.8, width, height);
    camera.fy *= random.uniform(0.9, 1.1) as f32;
    camera.cx += random.uniform(-0.05, 0.05) as f32 * width as f32;
    camera.cy += random.uniform(-0.05, 0.05) as f32 * height as f32;
    camera
}
