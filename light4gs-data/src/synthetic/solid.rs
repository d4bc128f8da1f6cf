//! A textured shape at a place.

use super::shapes::Shape;
use super::texture::Texture;
use glam::{Mat3, Vec3};

/// A solid at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    pub(super) shape: Shape,
    pub(super) texture: Texture,
    /// Own to world axes.
    pub(super) rotation: Mat3,
    pub(super) center: Vec3,
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
