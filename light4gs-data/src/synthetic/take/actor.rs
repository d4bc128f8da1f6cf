//! Things that move in a take: how they look, and where they are at a time.

use crate::synthetic::shapes::Shape;
use crate::synthetic::solid::Solid;
use crate::synthetic::texture::{Pattern, Texture, hue_color};
use glam::{Mat3, Vec2, Vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Within this many seconds an actor turns to where it goes.
const TURN: f32 = 0.6;
/// A hop of a ball is about this long, and this high for its length, world units.
const HOP: (f32, f32) = (0.8, 0.35);
/// Two steps of a figure, world units.
const STRIDE: f32 = 0.7;

/// A way from one place on the floor to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Seconds.
    pub(super) start: f32,
    /// Seconds.
    pub(super) end: f32,
    pub(super) from: Vec2,
    pub(super) to: Vec2,
}

impl Leg {
    /// The share of the way that is done: it begins and ends slowly.
    fn share(&self, seconds: f32) -> f32 {
        let share = ((seconds - self.start) / (self.end - self.start)).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }

    pub(super) fn at(&self, seconds: f32) -> Vec2 {
        self.from.lerp(self.to, self.share(seconds))
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Rolls and hops.
    Ball { radius: f32 },
    /// Slides.
    Crate { half: Vec3 },
    /// Rolls upright.
    Wheel { major: f32, minor: f32 },
    /// Walks: two legs, a body, two arms and a head.
    Figure,
}

/// A thing that stands where it is put, and goes its legs.
#[derive(Clone, Debug)]
pub(super) struct Actor {
    kind: Kind,
    /// Of the body, and of the rest.
    textures: [Texture; 2],
    /// Where it stands before its first leg.
    home: Vec2,
    /// In the order of time, without overlap; each begins where the one before ends.
    legs: Vec<Leg>,
    /// What each leg begins with: heading (radians), the way that was rolled before (world units), and a ball's turn.
    begins: Vec<(f32, f32, Mat3)>,
}

/// Solids that are near each other.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) center: Vec3,
    /// Radius of a sphere around the center that contains all of them.
    pub(super) bound: f32,
    pub(super) solids: Vec<Solid>,
}

impl Group {
    pub(super) fn new(solids: Vec<Solid>) -> Self {
        let center = solids.iter().map(|solid| solid.center).sum::<Vec3>() / solids.len().max(1) as f32;
        let bound = solids.iter().map(|solid| (solid.center - center).length() + solid.bound).fold(0.0, f32::max);
        Self { center, bound, solids }
    }

    /// Whether a ray comes near enough that the solids must be tested.
    pub(super) fn may_hit(&self, origin: Vec3, direction: Vec3) -> bool {
        let to_center = self.center - origin;
        let along = to_center.dot(direction);
        (to_center - direction * along).length_squared() <= self.bound * self.bound
    }
}

impl Actor {
    /// An actor of this kind at a place, in random colors.
    pub(super) fn new(kind: Kind, home: Vec2, rng: &mut ChaCha8Rng) -> Self {
        let hue: f32 = rng.random_range(0.0..1.0);
        let mut texture = |hue: f32, kind: Pattern, frequency: f32| Texture {
            colors: [hue_color(hue, 0.85, 0.8), hue_color(hue + rng.random_range(0.15..0.5), 0.5, 0.95)],
            kind,
            frequency,
            phase: rng.random_range(0.0..TAU),
        };
        let textures = match kind {
            Kind::Ball { .. } => [texture(hue, Pattern::Stripes, 18.0); 2],
            // A checker is a product of three waves. On each side of the crate one of them is constant, at an extreme.
            Kind::Crate { .. } => [Texture { phase: FRAC_PI_2, ..texture(hue, Pattern::Checker, 15.0) }; 2],
            Kind::Wheel { .. } => [texture(hue, Pattern::Sectors, 8.0); 2],
            Kind::Figure => [texture(hue, Pattern::Stripes, 26.0), texture(hue + 0.5, Pattern::Stripes, 14.0)],
        };
        Self { kind, textures, home, legs: Vec::new(), begins: Vec::new() }
    }

    /// Adds a leg, which must begin after the last one.
    pub(super) fn go(&mut self, leg: Leg) {
        let begin = match (self.legs.last(), self.begins.last()) {
            (Some(last), Some((heading, rolled, turn))) => {
                let way = last.to - last.from;
                (turned(*heading, way, 1.0), rolled + way.length(), self.roll(last, 1.0) * *turn)
            }
            _ => ((leg.to - leg.from).to_angle(), 0.0, Mat3::IDENTITY),
        };
        self.begins.push(begin);
        self.legs.push(leg);
    }

    /// The leg that was begun last.
    fn leg(&self, seconds: f32) -> Option<usize> {
        self.legs.partition_point(|leg| leg.start <= seconds).checked_sub(1)
    }

    /// Its place on the floor at a time.
    pub(super) fn at(&self, seconds: f32) -> Vec2 {
        self.leg(seconds).map_or(self.home, |i| self.legs[i].at(seconds))
    }

    /// When its last leg ends, seconds.
    pub(super) fn last_second(&self) -> Option<f32> {
        self.legs.last().map(|leg| leg.end)
    }

    /// Its place after all its legs.
    pub(super) fn last_place(&self) -> Vec2 {
        self.legs.last().map_or(self.home, |leg| leg.to)
    }

    /// How far a ball is rolled after a share of a leg.
    fn roll(&self, leg: &Leg, share: f32) -> Mat3 {
        let Kind::Ball { radius } = self.kind else { return Mat3::IDENTITY };
        let way = leg.to - leg.from;
        let axis = Vec3::Z.cross(way.extend(0.0)).normalize_or(Vec3::X);
        Mat3::from_axis_angle(axis, share * way.length() / radius)
    }

    /// The solids of the actor at a time.
    pub(super) fn solids(&self, seconds: f32) -> Group {
        let place = self.at(seconds);
        let (mut heading, mut rolled, mut roll, mut hop, mut swing) = (0.0, 0.0, Mat3::IDENTITY, 0.0, 0.0);
        if let Some((first, ..)) = self.begins.first() {
            heading = *first;
        }
        if let Some(i) = self.leg(seconds) {
            let (leg, (before, rolled_before, turn)) = (&self.legs[i], self.begins[i]);
            let (way, share) = (leg.to - leg.from, leg.share(seconds));
            heading = turned(before, way, ((seconds - leg.start) / TURN).clamp(0.0, 1.0));
            rolled = rolled_before + share * way.length();
            roll = self.roll(leg, share) * turn;
            let hops = (way.length() / HOP.0).round().max(1.0);
            hop = HOP.1 * way.length() / hops * (PI * hops * share).sin().abs();
            // Arms and legs come to rest with the way.
            let pace = (4.0 * share * (1.0 - share)).sqrt();
            swing = 0.6 * pace * (TAU / STRIDE * share * way.length()).sin();
        }
        let yaw = Mat3::from_rotation_z(heading);
        let solid = |shape: Shape, texture: usize, rotation: Mat3, center: Vec3| Solid {
            shape,
            texture: self.textures[texture],
            rotation,
            center: place.extend(0.0) + center,
            bound: shape.bound(),
            moves: true,
        };
        Group::new(match self.kind {
            Kind::Ball { radius } => {
                vec![solid(Shape::Sphere { radius }, 0, roll, Vec3::new(0.0, 0.0, radius + hop))]
            }
            Kind::Crate { half } => vec![solid(Shape::Block { half }, 0, yaw, Vec3::new(0.0, 0.0, half.z))],
            Kind::Wheel { major, minor } => {
                // Around y it rolls forward, along x.
                let upright = Mat3::from_rotation_x(FRAC_PI_2);
                let rolls = yaw * Mat3::from_rotation_y(rolled / (major + minor)) * upright;
                vec![solid(Shape::Torus { major, minor }, 0, rolls, Vec3::new(0.0, 0.0, major + minor))]
            }
            Kind::Figure => {
                // A limb hangs on a joint: its side, height, half length and radius, world units.
                let limb = |side: f32, height: f32, half_length: f32, radius: f32, angle: f32| {
                    let joint = Vec3::new(0.0, side, height);
                    let hangs = Mat3::from_rotation_y(angle) * Vec3::new(0.0, 0.0, -half_length);
                    let shape = Shape::Capsule { half_length, radius };
                    solid(shape, 1, yaw * Mat3::from_rotation_y(angle), yaw * (joint + hangs))
                };
                vec![
                    solid(Shape::Capsule { half_length: 0.2, radius: 0.17 }, 0, yaw, Vec3::new(0.0, 0.0, 0.82)),
                    solid(Shape::Sphere { radius: 0.14 }, 1, yaw, Vec3::new(0.0, 0.0, 1.3)),
                    limb(0.09, 0.62, 0.25, 0.08, swing),
                    limb(-0.09, 0.62, 0.25, 0.08, -swing),
                    limb(0.23, 1.02, 0.2, 0.06, -swing),
                    limb(-0.23, 1.02, 0.2, 0.06, swing),
                ]
            }
        })
    }
}

/// The heading after a share of the turn from `before` to the direction of `way`, the shorter way round.
fn turned(before: f32, way: Vec2, share: f32) -> f32 {
    let angle = (way.to_angle() - before + PI).rem_euclid(TAU) - PI;
    before + angle * share * share * (3.0 - 2.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn an_actor_moves_without_jumps_and_stands_where_it_came_to_rest() {
        let kinds = [
            Kind::Ball { radius: 0.3 },
            Kind::Crate { half: Vec3::new(0.2, 0.3, 0.3) },
            Kind::Wheel { major: 0.3, minor: 0.1 },
            Kind::Figure,
        ];
        for kind in kinds {
            let mut actor = Actor::new(kind, Vec2::X, &mut ChaCha8Rng::seed_from_u64(2));
            actor.go(Leg { start: 1.0, end: 5.0, from: Vec2::X, to: Vec2::Y });
            actor.go(Leg { start: 6.0, end: 9.0, from: Vec2::Y, to: Vec2::NEG_X });
            let mut before = actor.solids(0.0);
            let mut moved = 0.0;
            for i in 1..=1000 {
                let now = actor.solids(i as f32 / 100.0);
                for (a, b) in before.solids.iter().zip(&now.solids) {
                    let turn = (a.rotation.x_axis - b.rotation.x_axis).length()
                        + (a.rotation.y_axis - b.rotation.y_axis).length();
                    assert!((a.center - b.center).length() < 0.03, "{kind:?} jumps at {i}");
                    assert!(turn < 0.2, "{kind:?} turns by {turn} at {i}");
                    assert!(b.center.z > 0.05 && (b.center - now.center).length() + b.bound <= now.bound + 1e-5);
                    moved += (a.center - b.center).length();
                }
                before = now;
            }
            assert!(moved > 2.5, "{kind:?}: {moved}");
            assert_eq!(actor.at(20.0), Vec2::NEG_X);
            let (rest, later) = (actor.solids(9.5), actor.solids(20.0));
            assert!(
                rest.solids.iter().zip(&later.solids).all(|(a, b)| a.center == b.center && a.rotation == b.rotation)
            );
        }
    }
}
