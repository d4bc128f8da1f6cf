//! The room of a take: what stands still in it. Seen from inside, it fills every image.

use crate::synthetic::shapes::Shape;
use crate::synthetic::solid::{Hit, Solid};
use crate::synthetic::texture::{Pattern, Texture, hue_color};
use glam::{Mat3, Vec2, Vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Half the sides of the floor, world units; the middle is the origin.
pub(super) const HALF: f32 = 4.5;
/// Height of the ceiling, world units.
const HEIGHT: f32 = 3.4;
/// Half the width of a door, its height, and the width of its frame, world units.
pub(super) const DOOR: (f32, f32, f32) = (0.6, 1.9, 0.1);
/// The doors: unit vectors from the middle of the floor to the middles of their walls.
pub(super) const DOORS: [Vec2; 3] = [Vec2::NEG_X, Vec2::X, Vec2::Y];
/// The pedestal: half its side, and its height, world units.
const PEDESTAL: (f32, f32) = (0.28, 0.5);
/// Radius around the middle of the floor that the pedestal takes, world units.
pub(super) const TAKEN: f32 = 0.4;
/// How dark it is behind a door.
const DARK: f32 = 0.06;

/// A picture on a wall.
#[derive(Clone, Copy, Debug)]
struct Picture {
    /// Its middle: along the wall, and above the floor, world units.
    middle: Vec2,
    half: Vec2,
    texture: Texture,
}

/// Floor, ceiling, four walls with doors and pictures, and furniture.
#[derive(Debug)]
pub(super) struct Room {
    floor: Texture,
    ceiling: Texture,
    /// At -x, +x, -y, +y.
    walls: [Texture; 4],
    pictures: [[Picture; 2]; 4],
    pub(super) furniture: Vec<Solid>,
}

impl Room {
    /// Colors, pictures and furniture are random; walls and doors are always the same.
    pub(super) fn new(rng: &mut ChaCha8Rng) -> Self {
        let turn: f32 = rng.random_range(0.0..1.0);
        let mut paint = |kind, hue: f32, (dark, light): (f32, f32), saturation: f32, period: f32| Texture {
            colors: [hue_color(hue + turn, saturation, dark), hue_color(hue + turn + 0.06, 0.6 * saturation, light)],
            kind,
            frequency: TAU / period,
            phase: rng.random_range(0.0..TAU),
        };
        let wall = |kind, hue, period| (kind, hue, (0.5, 0.85), 0.4, period);
        let walls = [
            wall(Pattern::Tiles, 0.1, 0.7),
            wall(Pattern::Boards, 0.55, 0.3),
            wall(Pattern::Marble, 0.3, 1.4),
            wall(Pattern::Boards, 0.8, 0.45),
        ]
        .map(|(kind, hue, value, saturation, period)| paint(kind, hue, value, saturation, period));
        let floor = paint(Pattern::Tiles, 0.05, (0.35, 0.75), 0.35, 0.6);
        let ceiling = paint(Pattern::Boards, 0.1, (0.7, 0.95), 0.12, 0.5);
        let stone = paint(Pattern::Marble, 0.6, (0.45, 0.9), 0.3, 0.5);
        let wood = paint(Pattern::Boards, 0.05, (0.35, 0.7), 0.6, 0.2);
        let jar = paint(Pattern::Stripes, 0.45, (0.6, 0.9), 0.7, 0.22);
        let ring =
            Texture { kind: Pattern::Sectors, frequency: 10.0, ..paint(Pattern::Sectors, 0.9, (0.6, 0.95), 0.8, 1.0) };
        let picture = |k: usize, rng: &mut ChaCha8Rng| {
            let side = if k.is_multiple_of(2) { -1.0 } else { 1.0 };
            let hue: f32 = rng.random_range(0.0..1.0);
            let kind = [Pattern::Target, Pattern::Checker, Pattern::Sectors][rng.random_range(0..3)];
            let frequency = if matches!(kind, Pattern::Sectors) { 7.0 } else { 9.0 };
            let colors = [hue_color(hue, 0.8, 0.7), hue_color(hue + 0.35, 0.5, 0.95)];
            // A checker is a product of three waves; where the third one is 1, it is one of two.
            let phase = if matches!(kind, Pattern::Checker) { FRAC_PI_2 } else { rng.random_range(0.0..TAU) };
            Picture {
                middle: Vec2::new(side * rng.random_range(1.9..3.1), rng.random_range(1.4..2.2)),
                half: Vec2::new(rng.random_range(0.45..0.85), rng.random_range(0.4..0.7)),
                texture: Texture { colors, kind, frequency, phase },
            }
        };
        let pictures = std::array::from_fn(|_| std::array::from_fn(|k| picture(k, rng)));
        let furniture = furniture(stone, wood, jar, ring);
        Self { floor, ceiling, walls, pictures, furniture }
    }

    /// The wall, floor or ceiling that a ray from inside meets.
    pub(super) fn hit(&self, origin: Vec3, direction: Vec3) -> Hit {
        // A ray along a wall would be a division by zero, so tiny components are replaced.
        let tiny = direction.abs().cmplt(Vec3::splat(1e-9));
        let direction = Vec3::select(tiny, Vec3::splat(1e-9), direction);
        let ahead = direction.cmpgt(Vec3::ZERO);
        let sides = Vec3::select(ahead, Vec3::new(HALF, HALF, HEIGHT), Vec3::new(-HALF, -HALF, 0.0));
        let distances = (sides - origin) / direction;
        let axis = distances.min_position();
        let distance = distances[axis];
        let place = origin + direction * distance;
        let mut normal = Vec3::ZERO;
        normal[axis] = -direction[axis].signum();
        let upper = usize::from(direction[axis] > 0.0);
        let color = match axis {
            0 => self.wall(upper, Vec2::new(place.y, place.z), true),
            1 => self.wall(2 + upper, Vec2::new(place.x, place.z), upper == 1),
            _ if upper == 1 => self.ceiling.color(place.truncate().extend(0.0)),
            _ => self.floor.color(place.truncate().extend(0.0)),
        };
        Hit { distance, normal, color }
    }

    /// The color of a wall at a place: along it, and above the floor.
    fn wall(&self, number: usize, place: Vec2, has_door: bool) -> Vec3 {
        let (half, height, frame) = DOOR;
        if has_door && place.x.abs() < half + frame && place.y < height + frame {
            let inside = place.x.abs() < half && place.y < height;
            return if inside { Vec3::splat(DARK) } else { Vec3::new(0.82, 0.78, 0.7) };
        }
        for picture in &self.pictures[number] {
            let off = place - picture.middle;
            let outside = (off.abs() - picture.half).max_element();
            if outside < 0.0 {
                return picture.texture.color(off.extend(0.0));
            }
            if outside < 0.06 {
                return Vec3::new(0.2, 0.16, 0.13);
            }
        }
        self.walls[number].color(place.extend(0.0))
    }
}

/// A pedestal with a ring in the middle, pillars in the corners, a bench and jars along the walls.
fn furniture(stone: Texture, wood: Texture, jar: Texture, ring: Texture) -> Vec<Solid> {
    let solid = |shape: Shape, texture: Texture, rotation: Mat3, center: Vec3| Solid {
        shape,
        texture,
        rotation,
        center,
        bound: shape.bound(),
        moves: false,
    };
    let block = |half: Vec3, texture, x: f32, y: f32, z: f32| {
        solid(Shape::Block { half }, texture, Mat3::IDENTITY, Vec3::new(x, y, z))
    };
    let (side, height) = PEDESTAL;
    let upright = Mat3::from_rotation_x(FRAC_PI_2);
    let mut all = vec![
        block(Vec3::new(side, side, 0.5 * height), stone, 0.0, 0.0, 0.5 * height),
        solid(Shape::Torus { major: 0.2, minor: 0.07 }, ring, upright, Vec3::new(0.0, 0.0, height + 0.27)),
        block(Vec3::new(1.3, 0.22, 0.2), wood, 0.4, -4.2, 0.2),
        block(Vec3::new(0.22, 0.9, 0.2), wood, 4.2, 2.4, 0.2),
        block(Vec3::new(0.22, 0.35, 0.55), wood, -4.2, -2.2, 0.55),
    ];
    for (x, y) in [(-2.2, 4.15), (2.3, 4.1), (-4.1, 1.9), (4.1, -2.0), (-2.0, -4.1)] {
        all.push(solid(Shape::Capsule { half_length: 0.25, radius: 0.22 }, jar, Mat3::IDENTITY, Vec3::new(x, y, 0.4)));
    }
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let pillar = Vec3::new(0.25, 0.25, 0.5 * HEIGHT);
    all.extend(corners.map(|(x, y)| block(pillar, stone, 4.2 * x, 4.2 * y, pillar.z)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn a_ray_in_any_direction_meets_the_room() {
        let room = Room::new(&mut ChaCha8Rng::seed_from_u64(1));
        for eye in [Vec3::new(0.3, -0.2, 1.5), Vec3::new(3.6, 0.0, 1.1), Vec3::new(-2.0, -3.0, 2.0)] {
            for k in 0..500 {
                let (height, angle) = (1.0 - k as f32 / 250.0, 2.4 * k as f32);
                let across = (1.0 - height * height).max(0.0).sqrt();
                let ray = Vec3::new(across * angle.cos(), across * angle.sin(), height);
                let hit = room.hit(eye, ray);
                let place = eye + ray * hit.distance;
                assert!(hit.distance > 0.0 && place.truncate().abs().max_element() < HALF + 1e-3, "{place}");
                assert!((-1e-3..HEIGHT + 1e-3).contains(&place.z), "{place}");
                assert!(hit.normal.dot(ray) <= 0.0 && hit.color.min_element() >= 0.0 && hit.color.max_element() <= 1.0);
            }
        }
        let doorway = room.hit(Vec3::Z, Vec3::X);
        assert_eq!((doorway.distance, doorway.color), (HALF, Vec3::splat(DARK)));
        assert_ne!(room.hit(Vec3::Z, Vec3::NEG_Y).color, Vec3::splat(DARK));
    }
}
