//! The Gaussians of one time as other programs take them: flat arrays, row-major.

use light4gs_codec::rendering::{opacity, scale, unit_quaternion};
use light4gs_codec::{GaussianArrays, sh_rest_coefficients};

/// As gsplat's `rasterization` takes them.
///
/// No renderer draws a Gaussian whose quaternion has no direction. Here it gets the identity and opacity 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gsplat {
    /// `[N, 3]`, centers in world units.
    pub means: Vec<f32>,
    /// `[N, 4]`, unit quaternions (w, x, y, z).
    pub quats: Vec<f32>,
    /// `[N, 3]`, standard deviations in world units.
    pub scales: Vec<f32>,
    /// `[N]`, in [0, 1].
    pub opacities: Vec<f32>,
    /// `[N, K, 3]`, harmonics of all degrees, K = (degree + 1)².
    pub sh: Vec<f32>,
}

impl Gsplat {
    /// These Gaussians, activated.
    pub fn of(gaussians: &GaussianArrays) -> Self {
        let mut opacities: Vec<f32> = gaussians.opacity_logits.iter().map(|&logit| opacity(logit)).collect();
        let mut quats = Vec::with_capacity(4 * gaussians.len());
        for (&quat, opacity) in gaussians.quats.iter().zip(&mut opacities) {
            quats.extend(unit_quaternion(quat).unwrap_or_else(|| {
                *opacity = 0.0;
                [1.0, 0.0, 0.0, 0.0]
            }));
        }
        let rest = 3 * sh_rest_coefficients(gaussians.sh_degree);
        let mut sh = Vec::with_capacity((3 + rest) * gaussians.len());
        for (i, dc) in gaussians.sh_dc.iter().enumerate() {
            sh.extend_from_slice(dc);
            sh.extend_from_slice(&gaussians.sh_rest[rest * i..rest * (i + 1)]);
        }
        Self {
            means: gaussians.means.as_flattened().to_vec(),
            quats,
            scales: gaussians.log_scales.as_flattened().iter().map(|&log_scale| scale(log_scale)).collect(),
            opacities,
            sh,
        }
    }
}

/// As in the PLY files of the original 3D Gaussian Splatting: before the activations, with the bits of the `.l4gs`
/// file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inria {
    /// `[N, 3]`, centers in world units: `x`, `y`, `z`.
    pub means: Vec<f32>,
    /// `[N, 3]`, harmonics of degree 0: `f_dc_0` to `f_dc_2`.
    pub f_dc: Vec<f32>,
    /// `[N, 3 (K - 1)]`, the other harmonics: `f_rest_0` and so on, all coefficients of red, then green, then blue.
    pub f_rest: Vec<f32>,
    /// `[N]`, logits of the opacities: `opacity`.
    pub opacity: Vec<f32>,
    /// `[N, 3]`, natural logarithms of the standard deviations: `scale_0` to `scale_2`.
    pub scale: Vec<f32>,
    /// `[N, 4]`, quaternions (w, x, y, z) of any length: `rot_0` to `rot_3`.
    pub rot: Vec<f32>,
}

impl Inria {
    /// These Gaussians in the order of a PLY file.
    pub fn of(gaussians: &GaussianArrays) -> Self {
        let coefficients = sh_rest_coefficients(gaussians.sh_degree);
        let mut f_rest = Vec::with_capacity(gaussians.sh_rest.len());
        if coefficients > 0 {
            for rest in gaussians.sh_rest.chunks_exact(3 * coefficients) {
                for channel in 0..3 {
                    f_rest.extend(rest.iter().skip(channel).step_by(3));
                }
            }
        }
        Self {
            means: gaussians.means.as_flattened().to_vec(),
            f_dc: gaussians.sh_dc.as_flattened().to_vec(),
            f_rest,
            opacity: gaussians.opacity_logits.clone(),
            scale: gaussians.log_scales.as_flattened().to_vec(),
            rot: gaussians.quats.as_flattened().to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(quat: [f32; 4]) -> GaussianArrays {
        GaussianArrays {
            means: vec![[1.0, 2.0, 3.0]],
            log_scales: vec![[0.0, 2.0_f32.ln(), 1e30]],
            quats: vec![quat],
            opacity_logits: vec![0.0],
            sh_dc: vec![[0.1, 0.2, 0.3]],
            sh_degree: 1,
            sh_rest: (1..=9).map(|value| value as f32).collect(),
            further: Vec::new(),
        }
    }

    #[test]
    fn gsplat_gets_activated_values() {
        let arrays = Gsplat::of(&one([0.0, 0.0, 3.0, 4.0]));
        assert_eq!(arrays.quats, [0.0, 0.0, 0.6, 0.8]);
        assert_eq!(arrays.opacities, [0.5]);
        assert_eq!(arrays.scales[0], 1.0);
        assert!((arrays.scales[1] - 2.0).abs() < 1e-6 && arrays.scales[2].is_finite());
        assert_eq!(arrays.sh, [0.1, 0.2, 0.3, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    }

    #[test]
    fn what_has_no_orientation_is_not_drawn() {
        for quat in [[0.0; 4], [f32::MAX; 4], [f32::NAN; 4]] {
            let arrays = Gsplat::of(&one(quat));
            assert_eq!((arrays.quats, arrays.opacities), (vec![1.0, 0.0, 0.0, 0.0], vec![0.0]));
        }
    }

    #[test]
    fn inria_orders_harmonics_by_channel() {
        let arrays = Inria::of(&one([1.0, 0.0, 0.0, 0.0]));
        assert_eq!(arrays.f_rest, [1.0, 4.0, 7.0, 2.0, 5.0, 8.0, 3.0, 6.0, 9.0]);
        let mut flat = one([1.0, 0.0, 0.0, 0.0]);
        (flat.sh_degree, flat.sh_rest) = (0, Vec::new());
        assert!(Inria::of(&flat).f_rest.is_empty());
    }
}
