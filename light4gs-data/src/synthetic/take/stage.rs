//! A take's room, cast and light, and how a ray sees them.

use super::TakeOptions;
use super::actor::{Actor, Group};
use super::cameras::Cameras;
use super::choreography::{cast, is_outside};
use super::room::Room;
use crate::synthetic::light::{LIGHT, Light};
use crate::synthetic::solid::Hit;
use glam::{Vec2, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The light after it has changed: weaker, bluer and from the other side.
const EVENING: Light =
    Light { direction: Vec3::new(-0.58, 0.33, 0.744), ambient: 0.5, direct: 0.5, tint: Vec3::new(0.6, 0.66, 0.9) };
/// How long the light changes, seconds.
const CHANGE: f32 = 0.5;
/// The shadow below a thing: how dark, and its radius, world units.
const SHADOW: (f32, f32) = (0.45, 0.34);

/// The world of a take.
pub(super) struct Stage {
    room: Room,
    cast: Vec<Actor>,
    /// When the light changes, seconds.
    light: Option<f32>,
}

/// The world at one time.
pub(super) struct Moment<'s> {
    stage: &'s Stage,
    groups: Vec<Group>,
    shadows: Vec<Vec2>,
    light: Light,
}

impl Stage {
    pub(super) fn new(options: &TakeOptions, cameras: &Cameras) -> Self {
        let room = Room::new(&mut ChaCha8Rng::seed_from_u64(options.seed ^ 0x726f_6f6d));
        let cast = cast(options.seconds as f32, options.seed, &|seconds| cameras.places(seconds));
        Self { room, cast, light: options.light.map(|seconds| seconds as f32) }
    }

    pub(super) fn at(&self, seconds: f32) -> Moment<'_> {
        let inside = || self.cast.iter().filter(|actor| !is_outside(actor.at(seconds)));
        let changed = self.light.map_or(0.0, |light| ((seconds - light) / CHANGE).clamp(0.0, 1.0));
        Moment {
            stage: self,
            groups: inside().map(|actor| actor.solids(seconds)).collect(),
            shadows: inside().map(|actor| actor.at(seconds)).collect(),
            light: LIGHT.toward(&EVENING, changed * changed * (3.0 - 2.0 * changed)),
        }
    }
}

impl Moment<'_> {
    /// What a ray from inside the room meets: distance and color, and whether it is one of the cast.
    pub(super) fn see(&self, eye: Vec3, ray: Vec3) -> (f32, Vec3, bool) {
        let mut nearest: Option<(Hit, bool)> = None;
        for solid in &self.stage.room.furniture {
            if solid.may_hit(eye, ray) {
                let limit = nearest.as_ref().map_or(f32::INFINITY, |(hit, _)| hit.distance);
                nearest = solid.hit(eye, ray, limit).map(|hit| (hit, false)).or(nearest);
            }
        }
        for group in self.groups.iter().filter(|group| group.may_hit(eye, ray)) {
            for solid in group.solids.iter().filter(|solid| solid.may_hit(eye, ray)) {
                let limit = nearest.as_ref().map_or(f32::INFINITY, |(hit, _)| hit.distance);
                nearest = solid.hit(eye, ray, limit).map(|hit| (hit, true)).or(nearest);
            }
        }
        let room = self.stage.room.hit(eye, ray);
        // What stands behind a wall is not seen.
        if let Some((hit, moves)) = nearest.filter(|(hit, _)| hit.distance < room.distance) {
            return (hit.distance, self.light.shade(&hit, ray), moves);
        }
        let place = eye + ray * room.distance;
        let shadow = if place.z < 1e-3 { self.shadow(place.truncate()) } else { 1.0 };
        (room.distance, shadow * self.light.shade(&room, ray), false)
    }

    /// How much light reaches a place on the floor.
    fn shadow(&self, place: Vec2) -> f32 {
        let of = |middle: &Vec2| {
            let distance = middle.distance_squared(place) / (SHADOW.1 * SHADOW.1);
            if distance < 9.0 { 1.0 - SHADOW.0 * (-distance).exp() } else { 1.0 }
        };
        self.shadows.iter().map(of).product()
    }
}
