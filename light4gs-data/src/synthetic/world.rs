//! The procedural scene: solids, their motion and their textures.

use super::shapes::Shape;
use glam::{Mat3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Height of the ground disc, world units.
const GROUND: f32 = -0.6;

/// A smooth pattern between two colors; wavelengths are a tenth of an image or so.
#[derive(Clone, Copy, Debug)]
struct Texture {
    colors: [Vec3; 2],
    kind: Pattern,
    /// Radians for each world unit.
    frequency: f32,
    phase: f32,
}

#[derive(Clone, Copy, Debug)]
enum Pattern {
    /// Bands across the solid's z axis.
    Stripes,
    /// Soft cubes.
    Checker,
    /// Sectors around the solid's z axis; the frequency is their number.
    Sectors,
    /// Circles and sectors around the z axis.
    Target,
}

impl Texture {
    fn color(&self, p: Vec3) -> Vec3 {
        let angle = p.y.atan2(p.x);
        let wave = |x: f32| (self.frequency * x + self.phase).sin();
        let value = match self.kind {
            Pattern::Stripes => wave(p.z),
            Pattern::Checker => wave(p.x) * wave(p.y) * wave(p.z) * 1.6,
            Pattern::Sectors => (self.frequency.round() * angle + self.phase).sin(),
            Pattern::Target => {
                let radius = p.truncate().length();
                wave(radius) * (6.0 * angle).sin() * (3.0 * radius).min(1.0)
            }
        };
        // A soft edge: steeper than the sine, still without a jump.
        let mix = 0.5 + 0.5 * (1.8 * value).tanh();
        self.colors[0].lerp(self.colors[1], mix)
    }
}

/// A solid at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    shape: Shape,
    texture: Texture,
    /// Own to world axes.
    rotation: Mat3,
    center: Vec3,
    /// Radius of a sphere around the center that contains it.
    pub(super) bound: f32,
    /// Whether it is elsewhere, or turned, at another time.
    pub(super) moves: bool,
}

/// Where a ray hits the world.
pub(super) struct Hit {
    pub(super) distance: f32,
    pub(super) normal: Vec3,
    pub(super) color: Vec3,
}

impl Solid {
    /// Whether a ray comes near enough that the exact test is needed.
    pub(super) fn may_hit(&self, origin: Vec3, direction: Vec3) -> bool {
        let to_center = self.center - origin;
        let along = to_center.dot(direction);
        (to_center - direction * along).length_squared() <= self.bound * self.bound
    }

    /// The first intersection: distance, normal and texture color.
    pub(super) fn hit(&self, origin: Vec3, direction: Vec3, nearer_than: f32) -> Option<Hit> {
        let to_own = self.rotation.transpose();
        let (o, d) = (to_own * (origin - self.center), to_own * direction);
        let (distance, normal) = self.shape.hit(o, d)?;
        (distance < nearer_than).then(|| Hit {
            distance,
            normal: self.rotation * normal,
            color: self.texture.color(o + d * distance),
        })
    }
}

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

/// Hue (turns), saturation and value to red, green, blue.
fn hue_color(hue: f32, saturation: f32, value: f32) -> Vec3 {
    let channel = |shift: f32| {
        let x = ((hue + shift).rem_euclid(1.0) * 6.0 - 3.0).abs() - 1.0;
        value * (1.0 - saturation + saturation * x.clamp(0.0, 1.0))
    };
    Vec3::new(channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0))
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

    #[test]
    fn hues() {
        assert_eq!(hue_color(0.0, 1.0, 1.0), Vec3::X);
        assert!((hue_color(1.0 / 3.0, 1.0, 1.0) - Vec3::Y).length() < 1e-5);
        assert_eq!(hue_color(0.4, 0.0, 0.5), Vec3::splat(0.5));
    }
}
