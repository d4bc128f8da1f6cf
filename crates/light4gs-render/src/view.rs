//! How a scene is drawn: camera, background, degree of the harmonics.

use light4gs_codec::rendering::TILE;
use light4gs_data::Camera;

/// Camera, background and active SH degree of one image.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The camera. It has at least one pixel.
    pub camera: Camera,
    /// Color behind the Gaussians: red, green, blue.
    pub background: [f32; 3],
    /// Highest degree of the spherical harmonics that is used, 0 to 3.
    pub sh_degree: usize,
}

impl View {
    /// Tiles side by side.
    pub fn tiles_across(&self) -> usize {
        (self.camera.width as usize).div_ceil(TILE)
    }

    /// Tiles above each other.
    pub fn tiles_down(&self) -> usize {
        (self.camera.height as usize).div_ceil(TILE)
    }
}
