//! Lens distortion, and the pinhole image that would have been recorded without it.

use glam::DVec2;

/// How a lens bends rays: it maps a point `(x / z, y / z)` in front of the camera to the place where it is recorded.
///
/// Coefficients are those of OpenCV and COLMAP, without units; they do not depend on the image's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's rational model: `(1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`, and tangential terms.
    /// With `k4 = k5 = k6 = 0` it is the model of nerfies, HyperNeRF and COLMAP's `OPENCV`.
    RadialTangential {
        /// `k1` to `k6`.
        radial: [f64; 6],
        /// `p1`, `p2`.
        tangential: [f64; 2],
    },
    /// The polynomial of Brown and Conrady as nerfstudio and Metashape continue it:
    /// `1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸`, and tangential terms.
    BrownConrady {
        /// `k1` to `k4`.
        radial: [f64; 4],
        /// `p1`, `p2`.
        tangential: [f64; 2],
    },
    /// OpenCV's fisheye: the angle `a` to the axis becomes `a (1 + k1 a² + k2 a⁴ + k3 a⁶ + k4 a⁸)`.
    Fisheye {
        /// `k1` to `k4`.
        radial: [f64; 4],
    },
    /// COLMAP's `THIN_PRISM_FISHEYE`: the equidistant projection, then radial, tangential and thin-prism terms.
    ThinPrismFisheye {
        /// `k1` to `k4`.
        radial: [f64; 4],
        /// `p1`, `p2`.
        tangential: [f64; 2],
        /// `sx1`, `sy1`.
        prism: [f64; 2],
    },
    /// COLMAP's `FOV`: one angle, radians (Devernay and Faugeras, 2001).
    FieldOfView {
        /// The angle.
        omega: f64,
    },
}

impl Distortion {
    /// Where a point `(x / z, y / z)` is recorded, in the same units.
    pub fn apply(&self, point: DVec2) -> DVec2 {
        let r2 = point.length_squared();
        match *self {
            Self::RadialTangential { radial: [k1, k2, k3, k4, k5, k6], tangential } => {
                let factor = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                point * factor + tangential_shift(point, tangential)
            }
            Self::BrownConrady { radial: [k1, k2, k3, k4], tangential } => {
                let factor = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
                point * factor + tangential_shift(point, tangential)
            }
            Self::Fisheye { radial: [k1, k2, k3, k4] } => {
                let angle = r2.sqrt().atan();
                let a2 = angle * angle;
                let bent = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                point * ratio(bent, r2.sqrt())
            }
            Self::ThinPrismFisheye { radial: [k1, k2, k3, k4], tangential, prism } => {
                let on_sensor = point * ratio(r2.sqrt().atan(), r2.sqrt());
                let s2 = on_sensor.length_squared();
                let factor = 1.0 + s2 * (k1 + s2 * (k2 + s2 * (k3 + s2 * k4)));
                on_sensor * factor + tangential_shift(on_sensor, tangential) + DVec2::from(prism) * s2
            }
            Self::FieldOfView { omega } => {
                let radius = r2.sqrt();
                if omega.abs() < 1e-9 {
                    return point;
                }
                point * ratio((2.0 * radius * (omega / 2.0).tan()).atan() / omega, radius)
            }
        }
    }

    /// Whether every coefficient is 0, so that the lens is a pinhole.
    fn is_none(&self) -> bool {
        match self {
            Self::RadialTangential { radial, tangential } => radial.iter().chain(tangential).all(|k| *k == 0.0),
            Self::BrownConrady { radial, tangential } => radial.iter().chain(tangential).all(|k| *k == 0.0),
            // Even without coefficients these are not perspective projections.
            Self::Fisheye { .. } | Self::ThinPrismFisheye { .. } => false,
            Self::FieldOfView { omega } => *omega == 0.0,
        }
    }
}

/// `a / b`, and 1 where both are 0.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 1e-9 { a / b } else { 1.0 }
}

fn tangential_shift(p: DVec2, [p1, p2]: [f64; 2]) -> DVec2 {
    let r2 = p.length_squared();
    let xy = p.x * p.y;
    DVec2::new(2.0 * p1 * xy + p2 * (r2 + 2.0 * p.x * p.x), 2.0 * p2 * xy + p1 * (r2 + 2.0 * p.y * p.y))
}

/// A lens other than a pinhole: distortion, and skewed pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// How rays are bent.
    pub distortion: Distortion,
    /// Skew divided by the horizontal focal length: `u = fx (x + skew y) + cx`.
    pub skew: f64,
}

impl Lens {
    /// The lens with these coefficients; `None` where it is a pinhole.
    pub fn new(distortion: Distortion, skew: f64) -> Option<Self> {
        (!distortion.is_none() || skew != 0.0).then_some(Self { distortion, skew })
    }

    /// Where a point `(x / z, y / z)` is recorded, in the same units, skew included.
    pub fn apply(&self, point: DVec2) -> DVec2 {
        let bent = self.distortion.apply(point);
        DVec2::new(bent.x + self.skew * bent.y, bent.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_without_coefficients_is_a_pinhole() {
        let none = Distortion::RadialTangential { radial: [0.0; 6], tangential: [0.0; 2] };
        assert_eq!(Lens::new(none, 0.0), None);
        assert_eq!(none.apply(DVec2::new(0.3, -0.4)), DVec2::new(0.3, -0.4));
        assert!(Lens::new(none, 0.01).is_some());
        let equidistant = Distortion::Fisheye { radial: [0.0; 4] };
        assert!(Lens::new(equidistant, 0.0).is_some());
    }

    /// Values by hand from OpenCV's formulas (documentation of calib3d).
    #[test]
    fn models_follow_their_formulas() {
        let p = DVec2::new(0.3, -0.4); // r² = 0.25
        let radial = Distortion::RadialTangential { radial: [0.1, 0.2, 0.0, 0.0, 0.0, 0.0], tangential: [0.01, 0.02] };
        let factor = 1.0 + 0.1 * 0.25 + 0.2 * 0.0625;
        let x = 0.3 * factor + 2.0 * 0.01 * -0.12 + 0.02 * (0.25 + 2.0 * 0.09);
        let y = -0.4 * factor + 0.01 * (0.25 + 2.0 * 0.16) + 2.0 * 0.02 * -0.12;
        assert!((radial.apply(p) - DVec2::new(x, y)).length() < 1e-12);
        let fisheye = Distortion::Fisheye { radial: [0.1, 0.0, 0.0, 0.0] };
        let angle = 0.5f64.atan();
        let expected = p / 0.5 * (angle * (1.0 + 0.1 * angle * angle));
        assert!((fisheye.apply(p) - expected).length() < 1e-12);
        let prism =
            Distortion::ThinPrismFisheye { radial: [0.1, 0.0, 0.0, 0.0], tangential: [0.0; 2], prism: [0.0; 2] };
        assert!((prism.apply(p) - expected).length() < 1e-12);
        let fov = Distortion::FieldOfView { omega: 0.9 };
        let expected = p / 0.5 * ((2.0 * 0.5 * 0.45f64.tan()).atan() / 0.9);
        assert!((fov.apply(p) - expected).length() < 1e-12);
        for model in [radial, fisheye, prism, fov] {
            assert_eq!(model.apply(DVec2::ZERO), DVec2::ZERO);
        }
    }
}
