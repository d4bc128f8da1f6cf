//! Spatio-temporal significance of Gaussians, by which they are pruned (paper III-B).

use burn::backend::Dispatch;
use light4gs_data::Camera;

use crate::ops::significance::SignificanceOps;
use crate::scene::gaussians::GaussianTensors;
use crate::splatter::Splatter;

/// Share of the Gaussians whose volume lies below the reference volume of [`VolumeWeight`].
const VOLUME_QUANTILE: f64 = 0.9;

/// The quantity that is summed over the pixels that blend a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelContribution {
    /// The transmittance in front of the Gaussian, multiplied by the Gaussian's opacity. This is the paper's score.
    TransmittanceOpacity,
    /// The blending weight, transmittance times alpha.
    BlendingWeight,
    /// One for each pixel.
    PixelCount,
}

/// The factor `gamma(V)` of a Gaussian's volume `V`, the product of its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VolumeWeight {
    /// No factor.
    None,
    /// `clamp(V / V_90, 0, 1)^exponent`, where 90 % of the volumes are below `V_90`: the paper's.
    Clamped {
        /// `beta` in the paper.
        exponent: f64,
    },
}

impl VolumeWeight {
    /// One factor for each volume.
    pub fn of(self, volumes: &[f64]) -> Vec<f64> {
        let Self::Clamped { exponent } = self else { return vec![1.0; volumes.len()] };
        let mut sorted = volumes.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = (VOLUME_QUANTILE * volumes.len() as f64) as usize;
        let Some(&reference) = sorted.get(at) else { return vec![1.0; volumes.len()] };
        let factor = |volume: &f64| {
            let ratio = if reference > 0.0 { volume / reference } else { 1.0 };
            ratio.min(1.0).powf(exponent)
        };
        volumes.iter().map(factor).collect()
    }
}

/// Sums over images of the contributions of each of `N` Gaussians.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::{Camera, PointCloud};
/// use light4gs_model::{GaussiansConfig, PixelContribution, Significance, Splatter};
///
/// let positions = vec![[0.0; 3], [0.0, 9.0, 0.0]]; // the second is behind the first
/// let cloud = PointCloud { positions, colors: vec![[0.5; 3]; 2] };
/// let gaussians = GaussiansConfig::new().init(&cloud, &Device::flex());
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30);
/// let mut significance = Significance::new(2);
/// significance.add(&Splatter::new([1.0; 3], 0), gaussians.tensors(), &camera);
/// let sums = significance.sums(PixelContribution::BlendingWeight);
/// assert!(sums[0] > sums[1]);
/// ```
#[derive(Clone, Debug)]
pub struct Significance {
    /// Pixels, `T · alpha`, `T · opacity`.
    sums: Vec<[f64; 3]>,
}

impl Significance {
    /// For `count` Gaussians, without any image yet.
    pub fn new(count: usize) -> Self {
        Self { sums: vec![[0.0; 3]; count] }
    }

    /// Adds the image of raw attributes at a time, seen by a camera.
    ///
    /// # Panics
    /// If the number of Gaussians has changed.
    pub fn add(&mut self, splatter: &Splatter, gaussians: GaussianTensors, camera: &Camera) {
        let gaussians = gaussians.inner();
        let count = gaussians.means.dims()[0];
        let (inputs, view) = splatter.inputs(gaussians.activated(), camera, None);
        let values = burn::tensor::Tensor::<2>::from_dispatch(Dispatch::significance(inputs, view)).into_data();
        let values: Vec<f32> = values.iter().collect();
        let (rows, _) = values.as_chunks::<3>();
        assert_eq!(count, self.sums.len(), "the number of Gaussians has changed");
        // A backdrop's rows follow.
        for (sums, row) in self.sums.iter_mut().zip(rows) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += f64::from(*value);
            }
        }
    }

    /// `[N]`: the score over all images so far.
    pub fn sums(&self, contribution: PixelContribution) -> Vec<f64> {
        let column = match contribution {
            PixelContribution::PixelCount => 0,
            PixelContribution::BlendingWeight => 1,
            PixelContribution::TransmittanceOpacity => 2,
        };
        self.sums.iter().map(|sums| sums[column]).collect()
    }
}

/// `[N]`: the least significant share of the Gaussians, those whose score is at most the one at position `share · (N -
/// 1)`, rounded down, of the sorted scores. Gaussians with equal scores are treated alike, so it may be more than
/// `share`.
pub fn least_significant(scores: &[f64], share: f64) -> Vec<bool> {
    if scores.is_empty() || share <= 0.0 {
        return vec![false; scores.len()];
    }
    let mut sorted = scores.to_vec();
    sorted.sort_by(f64::total_cmp);
    let threshold = sorted[(share.min(1.0) * (scores.len() - 1) as f64) as usize];
    scores.iter().map(|score| *score <= threshold).collect()
}
