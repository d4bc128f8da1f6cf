//! Light, and the colors that surfaces have in it.

use super::solid::Hit;
use glam::Vec3;

/// The light of the quickstart's scene.
pub(super) const LIGHT: Light =
    Light { direction: Vec3::new(0.377, -0.472, 0.797), ambient: 0.55, direct: 0.45, tint: Vec3::ONE };

/// Light from one side, and from everywhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Unit vector to the light.
    pub(super) direction: Vec3,
    /// Share of the light that comes from everywhere.
    pub(super) ambient: f32,
    /// Share of the light that comes from `direction`.
    pub(super) direct: f32,
    /// Red, green and blue of all of it.
    pub(super) tint: Vec3,
}

impl Light {
    /// Lambert shading with much ambient light, and a small broad highlight that spherical harmonics can represent.
    pub(super) fn shade(&self, hit: &Hit, ray: Vec3) -> Vec3 {
        let diffuse = self.ambient + self.direct * hit.normal.dot(self.direction).max(0.0);
        let half = (self.direction - ray).normalize();
        let highlight = 0.12 * hit.normal.dot(half).max(0.0).powi(12);
        (hit.color * diffuse + Vec3::splat(highlight)) * self.tint
    }

    /// The light on the way to another one: 0 is this one, 1 the other.
    pub(super) fn toward(&self, other: &Self, share: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Self {
            direction: self.direction.lerp(other.direction, share).normalize_or(Vec3::Z),
            ambient: mix(self.ambient, other.ambient),
            direct: mix(self.direct, other.direct),
            tint: self.tint.lerp(other.tint, share),
        }
    }
}
