//! Moving Gaussians in the `4dgs` container: the Gaussians at successive times, as keyframes and the changes between
//! them.
//!
//! The container's keyframes have one color for each Gaussian, so colors that depend on the viewing direction are lost.
//! Positions, scales, rotations and opacities are rounded to the steps of its profile `fine`.

use std::io::Write;
use std::path::Path;

use fourdgs::GaussianSet;
use fourdgs::keyframe_delta_file::{KeyframeDeltaOptions, Sample, write_sequence};
use fourdgs::quantization::Profile;

use super::conventions::{srgb_to_linear, unit_xyzw};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::ply::GaussianPly;
use crate::points::SH_C0;

/// Samples from one keyframe to the next.
const KEYFRAME_INTERVAL: usize = 8;
/// The container's Gaussians fade with their distance in time. These fade so slowly, in durations of the scene, that it
/// cannot be seen.
const FADING: f64 = 1000.0;

/// The Gaussians at one time and until the next sample; row `i` is the same Gaussian in every sample.
#[derive(Clone, Debug)]
pub struct MotionSample {
    /// Seconds since the beginning; the first sample's is 0.
    pub begin: f64,
    /// The Gaussians at that time.
    pub gaussians: GaussianPly,
}

/// Writes samples that together last `duration` seconds. The file is complete or absent.
///
/// # Errors
/// [`DataError::Field`] with the container's reason, such as samples out of order; [`DataError::Io`] when the file
/// cannot be written.
pub fn write_four_dgs(path: &Path, samples: &[MotionSample], duration: f64) -> Result<(), DataError> {
    let samples: Vec<Sample> = samples.iter().map(|sample| population(sample, duration)).collect();
    let options = KeyframeDeltaOptions {
        keyframe_every: KEYFRAME_INTERVAL,
        profile: Profile::Fine,
        library: concat!("Light4GS ", env!("CARGO_PKG_VERSION")).to_owned(),
        ..KeyframeDeltaOptions::default()
    };
    let bytes = write_sequence(&samples, duration, &options)
        .map_err(|error| DataError::field(path, "samples", error.to_string(), "write PLY files instead"))?;
    write_atomically(path, |out| out.write_all(&bytes))
}

fn population(sample: &MotionSample, duration: f64) -> Sample {
    let GaussianPly { means, sh_dc, opacity_logits, log_scales, quats, .. } = &sample.gaussians;
    let count = means.len();
    let color = |(dc, logit): (&[f32; 3], &f32)| {
        let [r, g, b] = dc.map(|value| srgb_to_linear((value * SH_C0 + 0.5).clamp(0.0, 1.0)));
        [r, g, b, 1.0 / (1.0 + (-logit).exp())]
    };
    Sample {
        t0: sample.begin,
        ids: (0..count as i64).collect(),
        gaussians: GaussianSet {
            positions: means.concat(),
            scales: log_scales.iter().flatten().map(|scale| scale.exp()).collect(),
            rotations: quats.iter().flat_map(|quat| unit_xyzw(*quat)).collect(),
            colors: sh_dc.iter().zip(opacity_logits).flat_map(color).collect(),
            motions: vec![0.0; 3 * count],
            mu_t: vec![sample.begin as f32; count],
            sigma_t: vec![(FADING * duration) as f32; count],
            win_lo: vec![0.0; count],
            win_hi: vec![duration as f32; count],
            ..GaussianSet::default()
        },
    }
}
