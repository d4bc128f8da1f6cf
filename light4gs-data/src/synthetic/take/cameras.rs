//! The cameras of a take: one that moves on a smooth path, or a rig that stands still.

use super::TakeOptions;
use crate::camera::Camera;
use glam::{Vec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Horizontal field of view, radians: 70 degrees.
const FOV_X: f32 = 1.221_730_5;
/// Radius of the rig, world units, and the angle that it spans, radians.
const RIG: (f32, f32) = (3.6, 2.1);
/// Where all look: above the middle of the floor, world units.
const MIDDLE: Vec3 = Vec3::new(0.0, 0.0, 0.7);
/// At a cut the camera jumps by this angle around the middle, radians, and to this side of its height, world units.
const JUMP: (f32, f32) = (2.3, 0.35);

/// The cameras of a take at all times.
pub(super) struct Cameras {
    /// Cameras to train on; 1 moves.
    count: usize,
    size: (u32, u32),
    cut: Option<f32>,
    /// Where on its circle a moving camera begins, radians, and the way round: 1 or -1.
    begin: f32,
    way: f32,
    /// Phases of its detours, radians.
    phases: [f32; 4],
}

impl Cameras {
    pub(super) fn new(options: &TakeOptions) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0x6361_6d65);
        Self {
            count: options.cameras,
            size: (options.width, options.height),
            cut: options.cut.map(|seconds| seconds as f32),
            begin: rng.random_range(0.0..TAU),
            way: if rng.random_bool(0.5) { 1.0 } else { -1.0 },
            phases: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
        }
    }

    /// Whether the cameras stand still.
    pub(super) fn is_rig(&self) -> bool {
        self.count > 1
    }

    /// All cameras at a time, seconds. Of a rig the first is the one for testing.
    pub(super) fn at(&self, seconds: f32) -> Vec<Camera> {
        if self.is_rig() { self.rig() } else { vec![self.moving(seconds)] }
    }

    /// Where the cameras are on the floor at a time, seconds.
    pub(super) fn places(&self, seconds: f32) -> Vec<Vec2> {
        self.at(seconds).iter().map(|camera| camera.center().truncate()).collect()
    }

    /// Around the middle, nearer and farther, higher and lower, at walking pace.
    fn moving(&self, seconds: f32) -> Camera {
        let wave = |k: usize, period: f32| (TAU * seconds / period + self.phases[k]).sin();
        let jumped = self.cut.is_some_and(|cut| seconds >= cut);
        let (jump, rise) = if jumped { JUMP } else { (0.0, 0.0) };
        let angle = self.begin + self.way * TAU * seconds / 52.0 + 0.2 * wave(0, 17.0) + jump;
        let radius = 3.45 + 0.2 * wave(1, 23.0);
        let eye = (radius * Vec2::from_angle(angle)).extend(1.35 + 0.3 * wave(2, 13.0) + rise);
        let target = MIDDLE + Vec3::new(0.4 * wave(3, 19.0), 0.4 * wave(0, 29.0), 0.1 * wave(1, 11.0));
        self.camera(eye, target)
    }

    /// On an arc at -y, lower and higher by turns. The one for testing is between the two in the middle.
    fn rig(&self) -> Vec<Camera> {
        let step = RIG.1 / (self.count - 1) as f32;
        let place = |k: f32, height: f32| {
            let angle = -FRAC_PI_2 - 0.5 * RIG.1 + step * k;
            self.camera((RIG.0 * Vec2::from_angle(angle)).extend(height), MIDDLE)
        };
        let between = (self.count / 2) as f32 - 0.5;
        let trained = (0..self.count).map(|k| place(k as f32, if k.is_multiple_of(2) { 1.2 } else { 1.8 }));
        std::iter::once(place(between, 1.5)).chain(trained).collect()
    }

    fn camera(&self, eye: Vec3, target: Vec3) -> Camera {
        Camera::look_at(eye, target, Vec3::Z, FOV_X, self.size.0, self.size.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::take::room::HALF;

    #[test]
    fn a_moving_camera_stays_in_the_room_and_jumps_at_the_cut_only() {
        for seed in 0..8 {
            let cameras = Cameras::new(&TakeOptions { seed, cut: Some(20.0), ..Default::default() });
            let mut before = cameras.at(0.0)[0];
            for i in 1..3000 {
                let now = cameras.at(i as f32 / 50.0)[0];
                let moved = 50.0 * now.center().distance(before.center());
                let turned = 50.0 * (now.rotation.row(2) - before.rotation.row(2)).length();
                if i == 1000 {
                    assert!(now.center().distance(before.center()) > 2.0);
                } else {
                    assert!((0.05..1.0).contains(&moved) && turned < 0.6, "{moved} units a second at {i}");
                }
                assert!(now.center().truncate().length() < HALF - 0.7 && (0.6..2.3).contains(&now.center().z));
                before = now;
            }
        }
    }

    #[test]
    fn a_rig_has_one_camera_more_for_testing() {
        for count in [2, 3, 7, 20] {
            let cameras = Cameras::new(&TakeOptions { cameras: count, ..Default::default() });
            let (first, later) = (cameras.at(0.0), cameras.at(31.0));
            assert!(first.len() == count + 1 && first == later);
            let apart = |a: usize, b: usize| first[a].center().distance(first[b].center());
            assert!((0..=count).all(|a| (0..a).all(|b| apart(a, b) > 0.05)));
        }
    }
}
