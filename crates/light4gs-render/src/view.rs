//! How a scene is drawn: camera, background, degree of the harmonics.

use glam::Vec2;
use light4gs_codec::rendering::{FRUSTUM_MARGIN, TILE};
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
    /// The least and the largest slopes x/z and y/z at which the Jacobian of the projection is evaluated: those of the
    /// image's edges, moved out by [`FRUSTUM_MARGIN`] of half the image.
    pub fn slope_limits(&self) -> [Vec2; 2] {
        let Camera { fx, fy, cx, cy, width, height, .. } = self.camera;
        let focal = Vec2::new(fx, fy);
        let size = Vec2::new(width as f32, height as f32);
        // Zero, and so without any rounding, where the principal point is in the middle.
        let middle = (0.5 * size - Vec2::new(cx, cy)) / focal;
        let half = FRUSTUM_MARGIN * (size / (2.0 * focal));
        [middle - half, middle + half]
    }

    /// Tiles side by side.
    pub fn tiles_across(&self) -> usize {
        (self.camera.width as usize).div_ceil(TILE)
    }

    /// Tiles above each other.
    pub fn tiles_down(&self) -> usize {
        (self.camera.height as usize).div_ceil(TILE)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn limits(camera: Camera) -> [Vec2; 2] {
        View { camera, background: [0.0; 3], sh_degree: 0 }.slope_limits()
    }

    fn camera(width: u32, height: u32) -> Camera {
        Camera::look_at(Vec3::ONE, Vec3::ZERO, Vec3::Z, 0.9, width, height)
    }

    /// Files and golden vectors are from a time when this was the rule.
    #[test]
    fn a_principal_point_in_the_middle_gives_the_limits_of_3dgs_to_the_bit() {
        for (width, height) in [(1, 1), (7, 1001), (799, 600), (1920, 1081)] {
            let camera = camera(width, height);
            let (tan_x, tan_y) = camera.tan_half_fov();
            let most = FRUSTUM_MARGIN * Vec2::new(tan_x, tan_y);
            assert_eq!(limits(camera), [-most, most]);
        }
    }

    #[test]
    fn the_limits_are_the_edges_of_the_image_moved_out() {
        let camera = Camera { cx: -30.0, cy: 250.0, fx: 50.0, fy: 200.0, ..camera(100, 60) };
        let [least, most] = limits(camera);
        for (found, expected) in [
            (least, Vec2::new((30.0 - 15.0) / 50.0, (-250.0 - 9.0) / 200.0)),
            (most, Vec2::new((130.0 + 15.0) / 50.0, (-190.0 + 9.0) / 200.0)),
        ] {
            assert!(found.abs_diff_eq(expected, 1e-6), "{found} against {expected}");
        }
    }
}
