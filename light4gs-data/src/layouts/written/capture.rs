//! A capture of the synthetic scene with known cameras.

use crate::camera::Camera;
use crate::images::RgbImage8;
use crate::lens::{Distortion, Lens};
use crate::synthetic::Studio;
use glam::{DVec2, Vec3};

/// Width and height of the images, pixels: not square, odd, and with the principal point off the middle.
pub(crate) const SIZE: (u32, u32) = (97, 74);

/// One image of the capture.
pub(crate) struct Shot {
    pub(crate) name: String,
    pub(crate) pinhole: Camera,
    pub(crate) lens: Option<Lens>,
    pub(crate) time: f32,
}

/// The scene and the shots.
pub(crate) struct Capture {
    studio: Studio,
    pub(crate) shots: Vec<Shot>,
}

/// OpenCV's radial-tangential lens of a wide phone camera.
pub(crate) fn opencv() -> Lens {
    Lens::new(
        Distortion::RadialTangential { radial: [-0.12, 0.03, 0.0, 0.0, 0.0, 0.0], tangential: [0.002, -0.0015] },
        0.0,
    )
    .unwrap()
}

/// A fisheye of an action camera.
pub(crate) fn fisheye() -> Lens {
    Lens::new(Distortion::Fisheye { radial: [-0.02, 0.004, 0.0, 0.0] }, 0.0).unwrap()
}

impl Capture {
    /// Cameras on an arc that look at the middle. `plan` gives for each shot its name, the camera's place on the arc (0
    /// to 1), time and lens.
    pub(crate) fn new(centered: bool, plan: Vec<(String, f32, f32, Option<Lens>)>) -> Self {
        let shots = plan
            .into_iter()
            .map(|(name, on_arc, time, lens)| {
                let angle = 0.4 + 1.2 * on_arc;
                let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.0 + 0.3 * on_arc);
                let target = Vec3::new(0.05, -0.1, -0.1);
                let mut pinhole = Camera::look_at(eye, target, Vec3::Z, 0.95, SIZE.0, SIZE.1);
                if !centered {
                    (pinhole.cx, pinhole.cy, pinhole.fy) = (51.3, 34.2, pinhole.fx * 1.04);
                }
                Shot { name, pinhole, lens, time }
            })
            .collect();
        Self { studio: Studio::new(3), shots }
    }

    /// A moving camera: `count` frames called `PREFIX0000`...
    pub(crate) fn moving(prefix: &str, count: usize, lens: Option<Lens>) -> Self {
        let share = |i: usize| i as f32 / (count - 1) as f32;
        Self::new(false, (0..count).map(|i| (format!("{prefix}{i:04}"), share(i), share(i), lens)).collect())
    }

    /// The image as recorded through the shot's lens.
    pub(crate) fn recorded(&self, i: usize) -> RgbImage8 {
        let shot = &self.shots[i];
        let camera = &shot.pinhole;
        let axes = camera.rotation.transpose();
        self.studio.photograph(camera.center(), (camera.width, camera.height), shot.time, |u, v| {
            let seen = DVec2::new(f64::from((u - camera.cx) / camera.fx), f64::from((v - camera.cy) / camera.fy));
            let mut point = seen;
            if let Some(lens) = &shot.lens {
                // The inverse, by fixed-point iteration.
                for _ in 0..60 {
                    point += (seen - lens.apply(point)) * 0.9;
                }
            }
            (axes * Vec3::new(point.x as f32, point.y as f32, 1.0)).normalize()
        })
    }

    /// The image that a pinhole would have recorded, at a size.
    pub(crate) fn pinhole_image(&self, i: usize, size: (u32, u32)) -> RgbImage8 {
        let shot = &self.shots[i];
        let camera = shot.pinhole.resized(size.0, size.1);
        let axes = camera.rotation.transpose();
        self.studio.photograph(camera.center(), size, shot.time, |u, v| {
            (axes * Vec3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0)).normalize()
        })
    }
}
