//! Moving Gaussians in the `4dgs` container: the Gaussians at successive times, as keyframes and the changes between
//! them.
//!
//! The container's keyframes have one color for each Gaussian, so colors that depend on the viewing direction are lost.
//! Positions, scales, rotations and opacities are rounded to the steps of its profile `fine`.
//!
//! | file | what |
//! |---|---|
//! | `columns` | the Gaussians of a sample as whole numbers |
//! | `sequence` | the records of a file, sample by sample |

mod columns;
mod sequence;

use std::io::{self, Seek, Write};
use std::path::Path;

use self::sequence::SequenceWriter;
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::ply::GaussianPly;

/// The Gaussians at one time and until the next sample.
#[derive(Clone, Debug)]
pub struct MotionSample {
    /// Seconds since the beginning; the first sample's is 0.
    pub begin: f64,
    /// Whether its Gaussians are others than those of the sample before. If not, row `i` is the same Gaussian in both.
    pub anew: bool,
    /// The Gaussians at that time.
    pub gaussians: GaussianPly,
}

/// Writes samples that together last `duration` seconds. The file is complete or absent. Two samples are in memory at a time.
///
/// The steps of rounding are chosen by the places and scales of `typical` Gaussians, such as those of the first sample. Where a
/// sample has other Gaussians than the one before (`anew`, or another number of them), there is a keyframe, and the Gaussians have
/// identities that none had before.
///
/// # Errors
/// The first error of `samples`; [`DataError::Field`] with the reason for no samples, samples out of order and numbers that are not
/// finite; [`DataError::Io`] when the file cannot be written.
pub fn write_four_dgs<E: From<DataError>>(
    path: &Path,
    typical: &GaussianPly,
    samples: impl IntoIterator<Item = Result<MotionSample, E>>,
    duration: f64,
) -> Result<(), E> {
    let mut refused = None;
    let written = write_atomically(path, |file| {
        let problem = match write_samples(file, typical, samples, duration) {
            Ok(Ok(())) => return Ok(()),
            Ok(Err(problem)) => problem,
            Err(Refusal::Io(error)) => return Err(error),
            Err(Refusal::Reason(reason)) => DataError::field(path, "samples", reason, "write PLY files instead").into(),
        };
        refused = Some(problem);
        Err(io::Error::other("the samples were refused"))
    });
    match refused {
        Some(problem) => Err(problem),
        None => Ok(written?),
    }
}

/// The inner result is that of the samples' source.
fn write_samples<E>(
    file: &mut (impl Write + Seek),
    typical: &GaussianPly,
    samples: impl IntoIterator<Item = Result<MotionSample, E>>,
    duration: f64,
) -> Result<Result<(), E>, Refusal> {
    let mut sequence = SequenceWriter::begin(file, typical, duration)?;
    for sample in samples {
        match sample {
            Ok(sample) => sequence.add(&sample)?,
            Err(problem) => return Ok(Err(problem)),
        }
    }
    sequence.finish().map(Ok)
}

/// Why samples are not written.
enum Refusal {
    Io(io::Error),
    Reason(String),
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<fourdgs::Error> for Refusal {
    fn from(error: fourdgs::Error) -> Self {
        Self::Reason(error.to_string())
    }
}
