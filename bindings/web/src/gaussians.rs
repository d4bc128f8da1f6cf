//! Activated Gaussians, and the values that the vertex shader needs.

use std::ops::Range;

use light4gs_codec::rendering::MAX_LOGARITHM;
use light4gs_codec::{GaussianArrays, MotionOutput};

/// Numbers of one Gaussian that change with time: center (3), opacity, covariance xx, xy, xz, yy, yz, zz.
pub(crate) const FLOATS: usize = 10;

/// A quaternion that is shorter than this has no direction.
const SHORTEST_QUATERNION: f32 = 1e-12;

/// Standard deviations from their logarithms.
pub(crate) fn scales(log_scales: [f32; 3]) -> [f32; 3] {
    log_scales.map(|scale| scale.min(MAX_LOGARITHM).exp())
}

/// Opacity in [0, 1] from its logit.
pub(crate) fn opacity(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// The quaternion of unit length; none where it has no direction.
pub(crate) fn rotation(quaternion: [f32; 4]) -> Option<[f32; 4]> {
    let length = quaternion.iter().map(|q| q * q).sum::<f32>().sqrt();
    (length.is_finite() && length > SHORTEST_QUATERNION).then(|| quaternion.map(|q| q / length))
}

/// Upper triangle of `R S Sᵀ Rᵀ`: xx, xy, xz, yy, yz, zz.
fn covariance([w, x, y, z]: [f32; 4], scales: [f32; 3]) -> [f32; 6] {
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    let scaled = rows.map(|row| std::array::from_fn::<f32, 3, _>(|j| row[j] * scales[j]));
    let product = |a: usize, b: usize| (0..3).map(|j| scaled[a][j] * scaled[b][j]).sum();
    [product(0, 0), product(0, 1), product(0, 2), product(1, 1), product(1, 2), product(2, 2)]
}

/// Activated attributes that the motion does not change, computed once. The list of an attribute that may change is
/// empty.
#[derive(Debug, Default)]
pub(crate) struct Unchanged {
    scales: Vec<[f32; 3]>,
    opacities: Vec<f32>,
}

impl Unchanged {
    pub(crate) fn of(gaussians: &GaussianArrays, changes: impl Fn(MotionOutput) -> bool) -> Self {
        let mut unchanged = Self::default();
        if !changes(MotionOutput::LogScale) {
            unchanged.scales = gaussians.log_scales.iter().map(|&log_scales| scales(log_scales)).collect();
        }
        if !changes(MotionOutput::OpacityLogit) {
            unchanged.opacities = gaussians.opacity_logits.iter().map(|&logit| opacity(logit)).collect();
        }
        unchanged
    }
}

/// Packs a range of Gaussians, [`FLOATS`] numbers each. Their areas are multiplied by `growth`, where it is not empty.
/// Gaussians that cannot be drawn get opacity 0.
pub(crate) fn pack(
    gaussians: &GaussianArrays,
    unchanged: &Unchanged,
    growth: &[f32],
    range: Range<usize>,
    packed: &mut [f32],
) {
    for (gaussian, packed) in range.clone().zip(packed[FLOATS * range.start..].chunks_exact_mut(FLOATS)) {
        let known = unchanged.scales.get(gaussian).copied();
        let scales = known.unwrap_or_else(|| scales(gaussians.log_scales[gaussian]));
        let known = unchanged.opacities.get(gaussian).copied();
        packed[..3].copy_from_slice(&gaussians.means[gaussian]);
        packed[3] = known.unwrap_or_else(|| opacity(gaussians.opacity_logits[gaussian]));
        packed[4..].fill(0.0);
        if let Some(rotation) = rotation(gaussians.quats[gaussian]) {
            packed[4..].copy_from_slice(&covariance(rotation, scales));
        }
        if let Some(&growth) = growth.get(gaussian) {
            packed[4..].iter_mut().for_each(|value| *value *= growth);
        }
        if !packed[4..].iter().any(|value| *value != 0.0) || packed.iter().any(|value| !value.is_finite()) {
            packed.fill(0.0);
        }
    }
}

/// All attributes, activated, one behind the other: centers, standard deviations, unit quaternions, opacities, harmonics.
pub(crate) fn activated(gaussians: &GaussianArrays) -> Vec<f32> {
    let rest = gaussians.sh_rest.len() / gaussians.len().max(1);
    let mut attributes = Vec::with_capacity(gaussians.len() * (14 + rest));
    attributes.extend(gaussians.means.iter().flatten());
    attributes.extend(gaussians.log_scales.iter().flat_map(|&log_scales| scales(log_scales)));
    attributes.extend(gaussians.quats.iter().flat_map(|&quaternion| rotation(quaternion).unwrap_or_default()));
    attributes.extend(gaussians.opacity_logits.iter().map(|&logit| opacity(logit)));
    for gaussian in 0..gaussians.len() {
        attributes.extend_from_slice(&gaussians.sh_dc[gaussian]);
        attributes.extend_from_slice(&gaussians.sh_rest[rest * gaussian..][..rest]);
    }
    attributes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(log_scales: [f32; 3], quaternion: [f32; 4]) -> Vec<f32> {
        let gaussians = GaussianArrays {
            means: vec![[1.0, 2.0, 3.0]],
            log_scales: vec![log_scales],
            quats: vec![quaternion],
            opacity_logits: vec![0.0],
            sh_dc: vec![[0.0; 3]],
            sh_degree: 0,
            sh_rest: Vec::new(),
            further: Vec::new(),
        };
        let mut packed = vec![-1.0; FLOATS];
        pack(&gaussians, &Unchanged::default(), &[], 0..1, &mut packed);
        let mut again = vec![-1.0; FLOATS];
        pack(&gaussians, &Unchanged::of(&gaussians, |_| false), &[], 0..1, &mut again);
        assert_eq!(packed, again);
        packed
    }

    #[test]
    fn a_quarter_turn_around_z_exchanges_x_and_y() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let packed = one([2.0_f32.ln(), 3.0_f32.ln(), 0.0], [half * 5.0, 0.0, 0.0, half * 5.0]);
        let expected = [1.0, 2.0, 3.0, 0.5, 9.0, 0.0, 0.0, 4.0, 0.0, 1.0];
        for (found, expected) in packed.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{packed:?}");
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_transparent() {
        assert_eq!(one([0.0; 3], [0.0; 4]), [0.0; FLOATS]);
        assert_eq!(one([0.0; 3], [f32::MAX; 4]), [0.0; FLOATS]);
        assert_eq!(one([-80.0; 3], [1.0, 0.0, 0.0, 0.0]), [0.0; FLOATS]);
        // The covariance overflows.
        assert_eq!(one([60.0; 3], [1.0, 0.0, 0.0, 0.0])[3], 0.5);
        assert!(one([1e30; 3], [1.0, 0.0, 0.0, 0.0]).iter().all(|value| value.is_finite()));
    }
}
