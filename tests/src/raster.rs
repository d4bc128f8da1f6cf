//! Rendering the golden rasterizer scenes.

use burn::tensor::{Device, Tensor, s};
use light4gs_data::Camera;
use light4gs_model::{ActivatedGaussians, Rendering, Splatter};

use crate::golden::Golden;

/// The camera stored under a prefix such as `cam0.` or the empty one.
pub fn camera_of(golden: &Golden, prefix: &str, width: u32, height: u32) -> Camera {
    // Row-vector matrix: columns of the transposed upper block are the world-to-camera rotation's rows.
    let m = golden.values(&format!("{prefix}world_view_transform"));
    let tan = golden.values(&format!("{prefix}tanfov"));
    Camera {
        rotation: glam::Mat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]),
        translation: glam::Vec3::new(m[12], m[13], m[14]),
        fx: width as f32 / (2.0 * tan[0]),
        fy: height as f32 / (2.0 * tan[1]),
        cx: 0.5 * width as f32,
        cy: 0.5 * height as f32,
        width,
        height,
    }
}

/// Leaves of the tape for one golden scene.
pub struct Leaves {
    /// `[N, 3]`.
    pub means: Tensor<2>,
    /// `[N, 4]`.
    pub quats: Tensor<2>,
    /// `[N, 3]`.
    pub scales: Tensor<2>,
    /// `[N, 1]`.
    pub opacities: Tensor<2>,
    /// `[N, 16, 3]`.
    pub sh: Tensor<3>,
    /// `[N, 2]`.
    pub screen_offsets: Tensor<2>,
}

impl Leaves {
    /// Reads `means3D`, `quats`, `scales`, `opacity`, `sh`.
    pub fn read(golden: &Golden, device: &Device) -> Self {
        let means = golden.tensor::<2>("means3D", device).require_grad();
        let count = means.dims()[0];
        Self {
            means,
            quats: golden.tensor::<2>("quats", device).require_grad(),
            scales: golden.tensor::<2>("scales", device).require_grad(),
            opacities: golden.tensor::<2>("opacity", device).reshape([count, 1]).require_grad(),
            sh: golden.tensor::<3>("sh", device).require_grad(),
            screen_offsets: Tensor::zeros([count, 2], device).require_grad(),
        }
    }

    /// Renders with the active degree.
    pub fn render(&self, camera: &Camera, background: [f32; 3], degree: usize) -> Rendering {
        let [_, coefficients, _] = self.sh.dims();
        let gaussians = ActivatedGaussians {
            means: self.means.clone(),
            quats: self.quats.clone(),
            scales: self.scales.clone(),
            opacities: self.opacities.clone(),
            sh_dc: self.sh.clone().slice(s![.., 0..1, ..]),
            sh_rest: self.sh.clone().slice(s![.., 1..coefficients, ..]),
        };
        Splatter::new(background, degree).render_activated(gaussians, camera, Some(self.screen_offsets.clone()))
    }
}
