//! Patterns on surfaces.

use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// A smooth pattern between two colors; wavelengths are a tenth of an image or so.
#[derive(Clone, Copy, Debug)]
pub(super) struct Texture {
    pub(super) colors: [Vec3; 2],
    pub(super) kind: Pattern,
    /// Radians for each world unit.
    pub(super) frequency: f32,
    pub(super) phase: f32,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Pattern {
    /// Bands across the solid's z axis.
    Stripes,
    /// Soft cubes.
    Checker,
    /// Sectors around the solid's z axis; the frequency is their number.
    Sectors,
    /// Circles and sectors around the z axis.
    Target,
    /// Squares across the z axis, each with a shade of its own, and joints between them.
    Tiles,
    /// As tiles, four times as long as wide, each row shifted.
    Boards,
    /// Veins across the z axis.
    Marble,
}

impl Texture {
    /// The color at a place in the solid's own coordinates.
    pub(super) fn color(&self, p: Vec3) -> Vec3 {
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
            Pattern::Tiles => tiles(self.frequency / TAU * p.truncate(), 0.3 * wave(3.0 * p.x + 2.0 * p.y)),
            Pattern::Boards => {
                let place = self.frequency / TAU * p.truncate();
                let shifted = Vec2::new(place.x / 4.0 + 0.37 * place.y.floor(), place.y);
                tiles(shifted, 0.35 * wave(4.0 * p.y + (1.5 * p.x).sin()))
            }
            Pattern::Marble => {
                let bent = p.x + 0.6 * wave(0.7 * p.y) / self.frequency.max(1.0) + 0.5 * (1.3 * p.y + self.phase).sin();
                0.7 * wave(bent + 0.4 * p.y) + 0.4 * wave(2.3 * p.y - 1.1 * bent)
            }
        };
        // A soft edge: steeper than the sine, still without a jump.
        let mix = 0.5 + 0.5 * (1.8 * value).tanh();
        self.colors[0].lerp(self.colors[1], mix)
    }
}

/// Squares of side 1 with dark joints; `grain` is added within them.
fn tiles(place: Vec2, grain: f32) -> f32 {
    const JOINT: f32 = 0.05;
    let cell = place.floor();
    let within = place - cell;
    let to_edge = within.min(1.0 - within).min_element();
    let shade = 1.6 * share_of(cell.x as i32, cell.y as i32) - 0.8 + grain;
    let inside = (to_edge / JOINT).min(1.0);
    -1.5 + (shade + 1.5) * inside * inside * (3.0 - 2.0 * inside)
}

/// A number in `[0, 1)` for a cell of a grid, which looks random.
fn share_of(i: i32, j: i32) -> f32 {
    let mut bits = (i as u32).wrapping_mul(0x9e37_79b1) ^ (j as u32).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    (bits >> 8) as f32 / (1 << 24) as f32
}

/// Hue (turns), saturation and value to red, green, blue.
pub(super) fn hue_color(hue: f32, saturation: f32, value: f32) -> Vec3 {
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
    fn hues() {
        assert_eq!(hue_color(0.0, 1.0, 1.0), Vec3::X);
        assert!((hue_color(1.0 / 3.0, 1.0, 1.0) - Vec3::Y).length() < 1e-5);
        assert_eq!(hue_color(0.4, 0.0, 0.5), Vec3::splat(0.5));
    }
}
