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

use std::io;
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
        let write = || {
            let mut sequence = SequenceWriter::begin(file, typical, duration)?;
            for sample in samples {
                sequence.add(&sample.map_err(Problem::Sample)?)?;
            }
            sequence.finish()
        };
        write().map_err(|problem| {
            let problem = match problem {
                Problem::Io(error) => return error,
                Problem::Sample(error) => error,
                Problem::Refused(problem) => {
                    DataError::field(path, "samples", problem, "write PLY files instead").into()
                }
            };
            refused = Some(problem);
            io::Error::other("the samples were refused")
        })
    });
    match refused {
        Some(problem) => Err(problem),
        None => Ok(written?),
    }
}

/// Why a file is not written.
enum Problem<E> {
    Io(io::Error),
    /// An error of the samples' source.
    Sample(E),
    Refused(String),
}

impl<E> From<io::Error> for Problem<E> {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl<E> From<fourdgs::Error> for Problem<E> {
    fn from(error: fourdgs::Error) -> Self {
        Self::Refused(error.to_string())
    }
}
