//! Where a scene of Gaussians is, and how large: numbers that a few far or huge Gaussians do not change.

use glam::DVec3;
use light4gs_codec::GaussianArrays;
use light4gs_codec::rendering::MAX_LOGARITHM;

/// This share of the Gaussians is taken as the scene; in real captures the others are its far background.
const CORE: f64 = 0.8;
/// A Gaussian is seen as far as this many standard deviations.
const SEEN: f64 = 3.0;

/// The middle and the size of a scene, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// The median along each axis.
    pub(super) center: DVec3,
    /// Radius of a ball around it that has most of the means.
    pub(super) of_means: f64,
    /// Radius of a ball around it in which most of the scene is seen: above 0.
    pub(super) radius: f64,
}

impl Extent {
    /// The extent of Gaussians without NaN; scales may be 0.
    pub(super) fn of(gaussians: &GaussianArrays) -> Self {
        let mean = |mean: &[f32; 3]| DVec3::from_array(mean.map(f64::from));
        let middle = |axis: usize| quantile(gaussians.means.iter().map(|m| f64::from(m[axis])).collect(), 0.5);
        let center = DVec3::new(middle(0), middle(1), middle(2));
        let of_means = quantile(gaussians.means.iter().map(|m| center.distance(mean(m))).collect(), CORE);
        let largest = gaussians.log_scales.iter().map(|[x, y, z]| x.max(*y).max(*z).min(MAX_LOGARITHM));
        let size = quantile(largest.map(|log| f64::from(log).exp()).collect(), 0.5);
        // Gaussians in one place are as large as each of them.
        let radius = Some(of_means.max(SEEN * size)).filter(|radius| *radius > 0.0).unwrap_or(1.0);
        Self { center, of_means, radius }
    }
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (share * values.len().saturating_sub(1) as f64) as usize;
    values.get(at).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussians(means: Vec<[f32; 3]>, log_scale: f32) -> GaussianArrays {
        GaussianArrays { log_scales: vec![[log_scale; 3]; means.len()], means, ..GaussianArrays::default() }
    }

    #[test]
    fn outliers_do_not_change_it() {
        let around = |i: usize| [0, 1, 2].map(|axis| ((i * 7 + axis * 3) % 10) as f32 / 5.0 - 0.9);
        let plain = Extent::of(&gaussians((0..40).map(around).collect(), -3.0));
        let mut with_outliers = gaussians((0..42).map(around).collect(), -3.0);
        with_outliers.means[40] = [3e38; 3];
        with_outliers.log_scales[41] = [1e30; 3];
        let found = Extent::of(&with_outliers);
        assert!(found.center.abs_diff_eq(plain.center, 0.25), "{found:?} {plain:?}");
        assert!((found.radius / plain.radius - 1.0).abs() < 0.2, "{found:?} {plain:?}");
    }

    #[test]
    fn gaussians_in_one_place_have_their_own_size() {
        let found = Extent::of(&gaussians(vec![[0.5; 3]; 9], -2.0));
        assert_eq!((found.of_means, found.center), (0.0, DVec3::splat(0.5)));
        assert!((found.radius - 3.0 * (-2f64).exp()).abs() < 1e-9, "{found:?}");
        assert_eq!(Extent::of(&gaussians(vec![[0.5; 3]; 9], f32::NEG_INFINITY)).radius, 1.0);
        assert_eq!(Extent::of(&GaussianArrays::default()).radius, 1.0);
    }
}
