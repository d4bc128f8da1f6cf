//! Solids and their intersections with rays, in the solid's own coordinates.

use glam::{Vec2, Vec3};

/// Sphere tracing of the torus: most steps, and the distance at which a step has arrived.
const TRACE_STEPS: usize = 64;
const TRACE_ARRIVED: f32 = 2e-4;

/// A solid around the origin; lengths in world units.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Sphere {
        radius: f32,
    },
    Block {
        half: Vec3,
    },
    /// Along z: a cylinder of this half length with a half sphere at each end.
    Capsule {
        half_length: f32,
        radius: f32,
    },
    /// Around z.
    Torus {
        major: f32,
        minor: f32,
    },
    /// In the plane z = 0, without thickness.
    Disc {
        radius: f32,
    },
}

impl Shape {
    /// Radius of a sphere around the origin that contains the solid.
    pub(super) fn bound(self) -> f32 {
        match self {
            Self::Sphere { radius } | Self::Disc { radius } => radius,
            Self::Block { half } => half.length(),
            Self::Capsule { half_length, radius } => half_length + radius,
            Self::Torus { major, minor } => major + minor,
        }
    }

    /// The first intersection with a ray (unit `direction`) that starts outside: distance and outward normal.
    pub(super) fn hit(self, origin: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
        match self {
            Self::Sphere { radius } => {
                let (near, _) = sphere(origin, direction, radius)?;
                Some((near, (origin + direction * near) / radius))
            }
            Self::Block { half } => block(origin, direction, half),
            Self::Capsule { half_length, radius } => capsule(origin, direction, half_length, radius),
            Self::Torus { major, minor } => torus(origin, direction, major, minor),
            Self::Disc { radius } => {
                let distance = -origin.z / direction.z;
                let inside = (origin + direction * distance).truncate().length() <= radius;
                let toward = if origin.z >= 0.0 { Vec3::Z } else { Vec3::NEG_Z };
                (distance.is_finite() && distance > 0.0 && inside).then_some((distance, toward))
            }
        }
    }
}

/// The distances at which a ray enters and leaves a sphere around the origin, if the sphere is ahead.
pub(super) fn sphere(origin: Vec3, direction: Vec3, radius: f32) -> Option<(f32, f32)> {
    let along = -origin.dot(direction);
    // Distance of the center from the ray, computed without cancellation.
    let aside = (origin + direction * along).length_squared();
    let half = (radius * radius - aside).max(0.0).sqrt();
    (aside < radius * radius && along - half > 0.0).then_some((along - half, along + half))
}

fn block(origin: Vec3, direction: Vec3, half: Vec3) -> Option<(f32, Vec3)> {
    // A ray parallel to a face would be a division by zero, so tiny components are replaced.
    let tiny = direction.abs().cmplt(Vec3::splat(1e-9));
    let inverse = Vec3::select(tiny, Vec3::splat(1e-9), direction).recip();
    let center = -origin * inverse;
    let reach = half * inverse.abs();
    let enter = center - reach;
    let near = enter.max_element();
    let far = (center + reach).min_element();
    if near.is_nan() || far.is_nan() || near > far || near <= 0.0 {
        return None;
    }
    let axis = enter.max_position();
    let mut normal = Vec3::ZERO;
    normal[axis] = -direction[axis].signum();
    Some((near, normal))
}

fn capsule(origin: Vec3, direction: Vec3, half_length: f32, radius: f32) -> Option<(f32, Vec3)> {
    let mut best: Option<(f32, Vec3)> = None;
    let mut offer = |found: (f32, Vec3)| {
        if best.is_none_or(|(distance, _)| found.0 < distance) {
            best = Some(found);
        }
    };
    // The side: a circle in the plane across the axis, cut to the length.
    let (o, d) = (origin.truncate(), direction.truncate());
    let a = d.length_squared();
    if a > 1e-12 {
        let along = -o.dot(d) / a;
        let aside = (o + d * along).length_squared();
        if aside < radius * radius {
            let distance = along - ((radius * radius - aside) / a).sqrt();
            let point = origin + direction * distance;
            if distance > 0.0 && point.z.abs() <= half_length {
                offer((distance, point.truncate().extend(0.0) / radius));
            }
        }
    }
    for end in [half_length, -half_length] {
        let center = Vec3::new(0.0, 0.0, end);
        if let Some((distance, _)) = sphere(origin - center, direction, radius) {
            let point = origin + direction * distance;
            if point.z.abs() >= half_length && point.z * end > 0.0 {
                offer((distance, (point - center) / radius));
            }
        }
    }
    best
}

fn torus(origin: Vec3, direction: Vec3, major: f32, minor: f32) -> Option<(f32, Vec3)> {
    let (mut distance, end) = sphere(origin, direction, major + minor)?;
    for _ in 0..TRACE_STEPS {
        let point = origin + direction * distance;
        let ring = point.truncate().length();
        let gap = Vec2::new(ring - major, point.z).length() - minor;
        if gap < TRACE_ARRIVED {
            let on_ring = (point.truncate() * (major / ring.max(1e-6))).extend(0.0);
            return Some((distance, (point - on_ring).normalize_or(Vec3::Z)));
        }
        distance += gap;
        if distance > end {
            return None;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_each_solid_where_they_should() {
        let from = Vec3::new(3.0, 0.0, 0.0);
        let cases = [
            (Shape::Sphere { radius: 0.5 }, from, 2.5),
            (Shape::Block { half: Vec3::new(0.25, 9.0, 9.0) }, from, 2.75),
            (Shape::Capsule { half_length: 0.5, radius: 0.2 }, from, 2.8),
            (Shape::Capsule { half_length: 0.5, radius: 0.2 }, Vec3::new(0.0, 0.0, 3.0), 2.3),
            (Shape::Torus { major: 0.5, minor: 0.1 }, from, 2.4),
            (Shape::Disc { radius: 0.5 }, Vec3::new(0.1, 0.0, 3.0), 3.0),
        ];
        for (shape, origin, expected) in cases {
            let direction = if origin.x == 3.0 { Vec3::NEG_X } else { Vec3::NEG_Z };
            let (distance, normal) = shape.hit(origin, direction).unwrap();
            assert!((distance - expected).abs() < 1e-3, "{shape:?}: {distance}");
            assert!((normal + direction).length() < 1e-2, "{shape:?}: {normal}");
            assert!(shape.hit(origin, -direction).is_none(), "{shape:?} is not behind");
            let beside = origin + Vec3::Y * 10.0;
            assert!(shape.hit(beside, direction).is_none(), "{shape:?} is not that wide");
        }
        // Through the hole.
        let torus = Shape::Torus { major: 0.5, minor: 0.1 };
        assert!(torus.hit(Vec3::Z * 3.0, Vec3::NEG_Z).is_none());
    }
}
