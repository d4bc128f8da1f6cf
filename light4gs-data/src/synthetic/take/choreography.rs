//! Who goes where and when in a take: walkers that rarely rest, residents that stand for long and then move, and visitors
//! that come through a door and leave again or stay. Nobody walks through anybody, the pedestal or a camera.

use super::actor::{Actor, Kind, Leg};
use super::room::{DOOR, DOORS, HALF, TAKEN};
use glam::{Vec2, Vec3};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;
use std::ops::Range;

/// Actors stay within this distance of the middle, but for the way to a door, world units.
const FLOOR: f32 = 2.2;
/// Distance of two actors' middles, at least, world units.
const APART: f32 = 0.75;
/// Distance from a camera, at least, world units.
const FROM_CAMERA: f32 = 0.85;
/// A visitor waits this far behind a door, world units.
const BEHIND: f32 = 0.8;
/// Mean speeds, world units a second.
const SPEEDS: Range<f32> = 0.35..0.7;
/// A visitor comes about every so many seconds.
const VISITS: f32 = 6.0;
/// So many visitors stay.
const STAYING: usize = 2;
/// Places that are tried before an actor waits.
const TRIES: usize = 24;
/// Distances are checked this often, seconds.
const CHECKED: f32 = 0.1;
/// An actor that finds no way tries again after this time, seconds.
const PAUSE: f32 = 0.4;

#[derive(Clone, Copy, Debug)]
enum Role {
    Walker,
    Resident,
    /// Comes in by its first leg, goes so many more, and then leaves.
    Visitor {
        legs: usize,
    },
    /// Comes in, goes one more leg, and stays.
    Stayer {
        legs: usize,
    },
    /// Has left, or stays where it is.
    Done,
}

struct Member {
    actor: Actor,
    role: Role,
    /// When it next decides, seconds.
    free: f32,
}

/// The cast of a take of so many seconds. `cameras` gives the places of the cameras on the floor at a time.
pub(super) fn cast(seconds: f32, seed: u64, cameras: &dyn Fn(f32) -> Vec<Vec2>) -> Vec<Actor> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6361_7374);
    let mut members = company(seconds, &mut rng);
    // The one that is free first decides first, so that all others' ways are known as far as its own goes.
    while let Some(i) = next(&members, seconds) {
        decide(&mut members, i, cameras, &mut rng);
    }
    members.into_iter().map(|member| member.actor).collect()
}

fn next(members: &[Member], seconds: f32) -> Option<usize> {
    let open = (0..members.len()).filter(|i| members[*i].free < seconds && !matches!(members[*i].role, Role::Done));
    open.min_by(|a, b| members[*a].free.total_cmp(&members[*b].free))
}

/// Everybody who takes part, before anybody moves.
fn company(seconds: f32, rng: &mut ChaCha8Rng) -> Vec<Member> {
    let ball = Kind::Ball { radius: 0.28 };
    let wheel = Kind::Wheel { major: 0.27, minor: 0.1 };
    let block = Kind::Crate { half: Vec3::new(0.21, 0.21, 0.42) };
    let inside = [
        (Kind::Figure, Role::Walker),
        (ball, Role::Walker),
        (block, Role::Resident),
        (wheel, Role::Resident),
        (Kind::Figure, Role::Resident),
    ];
    let turn: f32 = rng.random_range(0.0..TAU);
    let mut members: Vec<Member> = Vec::new();
    for (k, (kind, role)) in inside.into_iter().enumerate() {
        let angle = turn + TAU * k as f32 / inside.len() as f32;
        let home = rng.random_range(1.2..FLOOR) * Vec2::from_angle(angle);
        let free = if matches!(role, Role::Walker) { 0.3 * k as f32 } else { 4.0 * (k as f32 - 1.0) };
        members.push(Member { actor: Actor::new(kind, home, rng), role, free });
    }
    let visits = (seconds / VISITS).ceil() as usize;
    for k in 0..visits {
        let kind = [Kind::Figure, ball, wheel, Kind::Figure, block][rng.random_range(0..5)];
        let door = DOORS[rng.random_range(0..DOORS.len())];
        let free = (k as f32 + rng.random_range(0.1..0.7)) * VISITS;
        let legs = rng.random_range(1..3);
        let stays = k % 3 == 1 && k / 3 < STAYING;
        let role = if stays { Role::Stayer { legs: 1 } } else { Role::Visitor { legs } };
        members.push(Member { actor: Actor::new(kind, behind(door), rng), role, free });
    }
    members
}

fn behind(door: Vec2) -> Vec2 {
    door * (HALF + BEHIND)
}

/// Whether a place is behind a wall.
pub(super) fn is_outside(place: Vec2) -> bool {
    place.abs().max_element() > HALF + 0.5
}

/// Sends a member on its next leg, or lets it wait.
fn decide(members: &mut [Member], i: usize, cameras: &dyn Fn(f32) -> Vec<Vec2>, rng: &mut ChaCha8Rng) {
    let member = &members[i];
    let (start, from) = (member.free, member.actor.last_place());
    let leaves = matches!(member.role, Role::Visitor { legs: 0 });
    let leg = goals(from, leaves, rng).into_iter().find_map(|to| {
        let end = start + 1.2 * from.distance(to) / rng.random_range(SPEEDS);
        let leg = Leg { start, end, from, to };
        is_free(members, i, &leg, cameras).then_some(leg)
    });
    let member = &mut members[i];
    let Some(leg) = leg else {
        member.free += PAUSE;
        return;
    };
    member.actor.go(leg);
    let rest = match member.role {
        Role::Walker => rng.random_range(0.1..0.8),
        Role::Resident => rng.random_range(6.0..14.0),
        _ => rng.random_range(0.4..3.0),
    };
    member.free = leg.end + rest;
    member.role = match member.role {
        Role::Visitor { .. } if is_outside(leg.to) => Role::Done,
        Role::Visitor { legs } => Role::Visitor { legs: legs.saturating_sub(1) },
        Role::Stayer { legs: 0 } => Role::Done,
        Role::Stayer { legs } => Role::Stayer { legs: legs - 1 },
        role => role,
    };
}

/// Places to go to, the preferred ones first: for one that leaves, those behind doors that it can reach, then those from which it
/// can reach a door.
fn goals(from: Vec2, leaves: bool, rng: &mut ChaCha8Rng) -> Vec<Vec2> {
    let reaches = |door: Vec2, place: Vec2| passes(behind(door), place);
    let mut goals = Vec::new();
    if leaves {
        goals.extend(DOORS.into_iter().filter(|door| reaches(*door, from)).map(behind));
        goals.shuffle(rng);
    }
    let doors = goals.len();
    for _ in 0..TRIES {
        let to = FLOOR * rng.random_range(0.3f32..1.0).sqrt() * Vec2::from_angle(rng.random_range(0.0..TAU));
        if from.distance(to) > 1.0 && (!is_outside(from) || passes(from, to)) {
            goals.push(to);
        }
    }
    if leaves {
        goals[doors..].sort_by_key(|place| !DOORS.iter().any(|door| reaches(*door, *place)));
    }
    goals
}

/// Whether a straight way from a place behind a door to one inside goes through the door.
fn passes(behind: Vec2, inside: Vec2) -> bool {
    let outward = behind.normalize_or_zero();
    let along = outward.dot(behind) - outward.dot(inside);
    let aside = outward.perp_dot(inside).abs() * BEHIND / along.max(1e-3);
    // The widest actor is as wide as half the door.
    aside < 0.45 * DOOR.0
}

/// Whether nobody is in the way, on the whole leg and after it.
fn is_free(members: &[Member], i: usize, leg: &Leg, cameras: &dyn Fn(f32) -> Vec<Vec2>) -> bool {
    // It may rest where it arrives: also those who are under way then must not come by.
    let known = members.iter().filter_map(|other| other.actor.last_second()).fold(leg.end, f32::max);
    let steps = ((known - leg.start) / CHECKED).ceil().max(1.0) as usize;
    (0..=steps).all(|step| {
        let seconds = leg.start + CHECKED * step as f32;
        let place = leg.at(seconds);
        if is_outside(place) && seconds > leg.end {
            return true;
        }
        if place.length() < TAKEN + 0.4 * APART || cameras(seconds).iter().any(|eye| eye.distance(place) < FROM_CAMERA)
        {
            return false;
        }
        members.iter().enumerate().all(|(k, other)| {
            let there = other.actor.at(seconds);
            k == i || is_outside(there) || there.distance(place) >= APART
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// One camera on a circle.
    fn camera(seconds: f32) -> Vec<Vec2> {
        vec![3.3 * Vec2::from_angle(0.1 * seconds)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn nobody_walks_through_anybody_and_something_moves_all_the_time(seed in 0u64..10_000, seconds in 8.0f32..70.0) {
            let cast = cast(seconds, seed, &camera);
            let mut still = 0.0f32;
            for step in 0..(10.0 * seconds) as usize {
                let now = step as f32 / 10.0;
                let places: Vec<Vec2> =
                    cast.iter().map(|actor| actor.at(now)).filter(|place| !is_outside(*place)).collect();
                for (k, place) in places.iter().enumerate() {
                    prop_assert!(place.length() > TAKEN);
                    // Between two checks both may have gone on by some hundredths.
                    prop_assert!(places[..k].iter().all(|other| other.distance(*place) > APART - 0.15), "at {now} s");
                }
                let speeds = cast.iter().map(|actor| 10.0 * actor.at(now).distance(actor.at(now + 0.1)));
                let fastest = speeds.fold(0.0, f32::max);
                prop_assert!(fastest < 1.5, "{fastest} units a second");
                still = if fastest > 0.02 { 0.0 } else { still + 0.1 };
                prop_assert!(still < 3.0, "nothing moves for {still} s before {now} s");
            }
        }
    }

    #[test]
    fn visitors_come_leave_and_stay_and_residents_start_after_standing() {
        let cast = cast(60.0, 0, &camera);
        assert_eq!(cast.len(), 5 + 10);
        let outside = |actor: &Actor, seconds: f32| is_outside(actor.at(seconds));
        let visitors = &cast[5..];
        assert!(visitors.iter().all(|actor| outside(actor, 0.0)));
        let left = visitors.iter().filter(|a| outside(a, 60.0) && (0..60).any(|s| !outside(a, s as f32))).count();
        let stayed = visitors.iter().filter(|a| (50..=60).all(|s| a.at(s as f32) == a.at(60.0)) && !outside(a, 60.0));
        assert!(left >= 3 && stayed.count() >= 1, "{left} left");
        let stood = |actor: &Actor, from: usize| (from..from + 5).all(|s| actor.at(s as f32) == actor.at(from as f32));
        for resident in &cast[2..5] {
            assert!((1..55).any(|s| stood(resident, s)), "it never rests");
            assert!(resident.at(0.0) != resident.at(60.0), "it never starts");
        }
        // Each part of the take has motion of its own.
        let part = |k: usize| -> Vec<Vec2> { cast.iter().map(|actor| actor.at(10.0 * k as f32 + 5.0)).collect() };
        assert!((0..6).all(|a| (0..a).all(|b| part(a) != part(b))));
    }
}
