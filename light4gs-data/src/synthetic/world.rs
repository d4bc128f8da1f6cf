//! The procedural scene of the quickstart: its solids and their motion.

use super::shapes::Shape;
use super::solid::Solid;
use super::texture::{Pattern, Texture, hue_color};
use glam::{Mat3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Height of the ground disc, world units.
const GROUND: f32 = -0.6;

/// The scene at all times.
#[derive(Debug)]
pub(super) struct World {
    ground: Texture,
    block: Texture,
    ball: Texture,
    marble: Texture,
    ring: Texture,
    clapper: Texture,
}

impl World {
    /// Colors and phases by seed; shapes and motion are always the same.
    pub(super) fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7465_7874);
        let turn = rng.random_range(0.0f32..1.0);
        let mut texture = |hue: f32, other: f32, kind: Pattern, frequency: f32| Texture {
            colors: [hue_color(hue + turn, 0.75, 0.85), hue_color(other + turn, 0.35, 0.95)],
            kind,
            frequency,
            phase: rng.random_range(0.0..TAU),
        };
        Self {
            ground: texture(0.60, 0.12, Pattern::Target, 14.0),
            block: texture(0.00, 0.15, Pattern::Checker, 16.0),
            ball: texture(0.33, 0.20, Pattern::Stripes, 24.0),
            marble: texture(0.75, 0.55, Pattern::Checker, 20.0),
            ring: texture(0.10, 0.90, Pattern::Sectors, 8.0),
            clapper: texture(0.50, 0.05, Pattern::Stripes, 30.0),
        }
    }

    /// All solids at a time in `[0, 1]`.
    pub(super) fn at(&self, time: f32) -> [Solid; 6] {
        let wave = TAU * time;
        let solid = |shape: Shape, texture: Texture, rotation: Mat3, center: Vec3| Solid {
            shape,
            texture,
            rotation,
            center,
            bound: shape.bound(),
            moves: true,
        };
        // Two bounces, while the ball rolls half a turn.
        let bounce = (wave.sin()).abs();
        let ball = Vec3::new(0.6, 0.1, GROUND + 0.25 + 0.55 * bounce);
        let marble = Vec3::new(-0.5 + 0.2 * wave.sin(), -0.5, GROUND + 0.2 + 0.15 * (1.0 - wave.cos()));
        // A pendulum: it hangs on (0.35, -0.55, 0.75).
        let swing = Mat3::from_rotation_y(0.6 * wave.cos());
        let clapper = Vec3::new(0.35, -0.55, 0.75) + swing * Vec3::new(0.0, 0.0, -0.5);
        let ring_turn = Mat3::from_rotation_x(0.5 + 0.6 * wave.sin()) * Mat3::from_rotation_z(FRAC_PI_2 * time);
        [
            Solid {
                moves: false,
                ..solid(Shape::Disc { radius: 1.0 }, self.ground, Mat3::IDENTITY, Vec3::new(0.0, 0.0, GROUND))
            },
            solid(
                Shape::Block { half: Vec3::new(0.19, 0.19, 0.26) },
                self.block,
                Mat3::from_rotation_z(FRAC_PI_2 * time) * Mat3::from_rotation_x(0.2),
                Vec3::new(0.0, 0.0, -0.1 + 0.12 * wave.sin()),
            ),
            solid(Shape::Sphere { radius: 0.25 }, self.ball, Mat3::from_rotation_y(PI * time), ball),
            solid(
                Shape::Sphere { radius: 0.2 },
                self.marble,
                // Distance along x over the radius.
                Mat3::from_rotation_y(wave.sin()),
                marble,
            ),
            solid(Shape::Torus { major: 0.26, minor: 0.09 }, self.ring, ring_turn, Vec3::new(-0.35, 0.55, 0.15)),
            solid(Shape::Capsule { half_length: 0.18, radius: 0.09 }, self.clapper, swing, clapper),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_stays_near_the_origin_and_moves_smoothly() {
        let world = World::new(0);
        let mut before = world.at(0.0);
        for i in 1..=200 {
            let now = world.at(i as f32 / 200.0);
            for (a, b) in before.iter().zip(&now) {
                assert!(b.center.length() + b.bound < 1.65);
                assert!((a.center - b.center).length() < 0.03);
                let stands = a.center == b.center && a.rotation == b.rotation;
                assert!(a.moves != stands, "{:?}", a.shape);
            }
            before = now;
        }
    }
}
