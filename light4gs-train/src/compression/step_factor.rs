//! One factor for the steps of all attributes, so that the file has a wished size or quality (`compression.target_bytes`,
//! `compression.target_db`).
//!
//! Learned steps are such that a bit more costs the same everywhere. One factor for all keeps that balance.

use std::fmt;

use light4gs_codec::{CodecError, CompressionInput, Compressor, Encoded, SceneData, ShCoding, checks};
use serde::{Deserialize, Serialize};

use crate::error::TrainError;

/// Steps become finer by at most this factor: more bytes than that do not show.
const FINEST: f32 = 0.25;
/// Steps become coarser by at most this factor: beyond it, nothing can be recognized.
const COARSEST: f32 = 16.0;
/// The search is over when the file fills this share of the bytes.
const FILLED: f64 = 0.98;
/// The search is over when the PSNR is no higher than the wished one by this, dB.
const ABOVE: f64 = 0.01;
/// Files that are tried: the factor is then known to 0.1 %.
const TRIES: usize = 12;

/// A wished quality that a file does not reach, PSNR in dB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissedQuality {
    /// The wished PSNR.
    pub wished: f64,
    /// The PSNR of the file with the finest steps.
    pub reached: f64,
}

impl fmt::Display for MissedQuality {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { wished, reached } = self;
        write!(
            formatter,
            "compression.target_db is {wished}, but this scene has {reached:.2} dB with the finest steps. For more, train \
             longer, with a smaller weight of the rate (compression.rate.attribute_lambda) or with more Gaussians \
             (train.prune.fraction, train.densify.adaptive.max_gaussians)"
        )
    }
}

/// A file, and how it was made. It has not been verified.
pub(super) struct ScaledFile {
    /// The steps, divided by the given ones.
    pub(super) factor: f32,
    /// The coding of the harmonics with these steps.
    pub(super) sh: ShCoding,
    /// The file.
    pub(super) encoded: Encoded,
}

impl ScaledFile {
    /// The file with the given steps.
    ///
    /// # Errors
    /// A scene or coding that the codec refuses.
    pub(super) fn unscaled(compressor: &Compressor, given: &CompressionInput) -> Result<Self, CodecError> {
        let encoded = compressor.encode(&given.attributes, &given.sh)?;
        Ok(Self { factor: 1.0, sh: given.sh.clone(), encoded })
    }

    /// The file with steps that are coarser by a factor. Planes stay as they are: their models know their steps.
    fn scaled(compressor: &Compressor, given: &CompressionInput, factor: f32) -> Result<Self, CodecError> {
        let steps = given.attributes.iter().map(|(name, step)| (name.to_owned(), step * factor));
        let steps = steps.fold(given.attributes.clone(), |all, (name, step)| all.with(&name, step)).clamped();
        let sh = match &given.sh {
            ShCoding::Channels { step } => ShCoding::Channels { step: checks::nearest_sh_step(step * factor) },
            coding => coding.clone(),
        };
        Ok(Self { factor, encoded: compressor.encode(&steps, &sh)?, sh })
    }

    fn bytes(&self) -> usize {
        self.encoded.bytes.len()
    }
}

/// The verdict on a factor that was tried.
enum Verdict {
    /// The file is as wished; one with finer or coarser steps may be better.
    Fits { coarser: bool, well: bool },
    /// It is not; look among finer or coarser steps.
    Misses { coarser: bool },
}

/// The largest file of at most `target` bytes.
///
/// # Errors
/// [`TrainError::Codec`] if the codec refuses the scene; [`TrainError::Input`] if it takes more bytes even with the coarsest
/// steps.
pub(super) fn encode_to_size(
    compressor: &Compressor,
    given: &CompressionInput,
    target: usize,
) -> Result<ScaledFile, TrainError> {
    let found = bisect(compressor, given, |file| {
        Ok(match file.bytes() <= target {
            true => Verdict::Fits { coarser: false, well: file.bytes() as f64 >= FILLED * target as f64 },
            false => Verdict::Misses { coarser: true },
        })
    })?;
    found.ok_or(()).or_else(|()| {
        let smallest = ScaledFile::scaled(compressor, given, COARSEST)?;
        match smallest.bytes() {
            bytes if bytes <= target => Ok(smallest),
            bytes => Err(TrainError::Input(format!(
                "compression.target_bytes is {target}, but this scene takes {bytes} bytes with the coarsest steps. Allow more \
                 bytes, or train fewer Gaussians (train.prune.fraction, train.densify.adaptive.max_gaussians)"
            ))),
        }
    })
}

/// The smallest file whose decoded scene has at least `target` dB; `psnr` measures a scene. If no file has that, the one with
/// the finest steps, and its quality.
///
/// # Errors
/// [`TrainError::Codec`] if the codec refuses the scene; the error of `psnr`.
pub(super) fn encode_to_quality(
    compressor: &Compressor,
    given: &CompressionInput,
    target: f64,
    psnr: &dyn Fn(&SceneData) -> Result<f64, TrainError>,
) -> Result<(ScaledFile, Option<MissedQuality>), TrainError> {
    let found = bisect(compressor, given, |file| {
        let above = psnr(&file.encoded.decoded)? - target;
        Ok(match above >= 0.0 {
            true => Verdict::Fits { coarser: true, well: above <= ABOVE },
            false => Verdict::Misses { coarser: false },
        })
    })?;
    if let Some(file) = found {
        return Ok((file, None));
    }
    let best = ScaledFile::scaled(compressor, given, FINEST)?;
    let reached = psnr(&best.encoded.decoded)?;
    Ok((best, (reached < target).then_some(MissedQuality { wished: target, reached })))
}

/// Halves the range of factors until a file fits well. Returns the last that fits.
fn bisect(
    compressor: &Compressor,
    given: &CompressionInput,
    judge: impl Fn(&ScaledFile) -> Result<Verdict, TrainError>,
) -> Result<Option<ScaledFile>, TrainError> {
    let mut found = None;
    let (mut fine, mut coarse) = (FINEST.ln(), COARSEST.ln());
    let mut at = 0.0_f32;
    for _ in 0..TRIES {
        let coarser = match ScaledFile::scaled(compressor, given, at.exp()) {
            Ok(file) => match judge(&file)? {
                Verdict::Fits { coarser, well } => {
                    found = Some(file);
                    if well {
                        break;
                    }
                    coarser
                }
                Verdict::Misses { coarser } => coarser,
            },
            // Values may be legal with the given steps, and too many of the finer ones.
            Err(_) if at < 0.0 => true,
            Err(problem) => return Err(problem.into()),
        };
        *(if coarser { &mut fine } else { &mut coarse }) = at;
        at = 0.5 * (fine + coarse);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use light4gs_codec::attributes::AttributeSteps;
    use light4gs_codec::{GaussianLayers, Limits, Profile, WeightPrecisions, encode_compressed};

    use super::*;
    use crate::compression::attribute_step_search::tests::scene;

    fn input() -> CompressionInput {
        CompressionInput {
            profile: Profile::Compact,
            planes: None,
            sh: ShCoding::Channels { step: 0.02 },
            attributes: AttributeSteps::default(),
            weights: WeightPrecisions::default(),
            layers: GaussianLayers::default(),
        }
    }

    fn given() -> Encoded {
        encode_compressed(&scene(), &input()).unwrap()
    }

    fn to_size(target: usize) -> Result<ScaledFile, TrainError> {
        encode_to_size(&Compressor::new(&scene(), &input()).unwrap(), &input(), target)
    }

    fn to_quality(target: f64) -> (ScaledFile, Option<MissedQuality>) {
        encode_to_quality(&Compressor::new(&scene(), &input()).unwrap(), &input(), target, &quality).unwrap()
    }

    #[test]
    fn a_file_fills_the_bytes_that_it_may_have() {
        let given = given().bytes.len();
        for target in [given, given * 2 / 3, given * 5 / 4] {
            let file = to_size(target).unwrap();
            file.encoded.verify(&Limits::large()).unwrap();
            let bytes = file.bytes();
            assert!(bytes <= target && bytes as f64 >= 0.95 * target as f64, "{bytes} of {target}");
            assert_eq!(file.factor > 1.0, target < given, "{target}");
        }
    }

    #[test]
    fn too_few_bytes_are_refused() {
        let problem = to_size(300).err().unwrap().to_string();
        assert!(problem.contains("compression.target_bytes is 300, but this scene takes"), "{problem}");
    }

    /// "PSNR" of colors against the exact ones.
    fn quality(decoded: &SceneData) -> Result<f64, TrainError> {
        let errors = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
        let (found, exact) = (&decoded.gaussians.sh_dc, &scene().gaussians.sh_dc);
        let sum: f64 = found.as_flattened().iter().zip(exact.as_flattened()).map(errors).sum();
        Ok(-10.0 * (sum / found.as_flattened().len() as f64).log10())
    }

    #[test]
    fn a_file_is_as_good_as_it_must_be_and_no_larger() {
        let at = |target| to_quality(target).0;
        let given = given();
        let reached = quality(&given.decoded).unwrap();
        for target in [reached - 6.0, reached, reached + 3.0] {
            let file = at(target);
            let above = quality(&file.encoded.decoded).unwrap() - target;
            assert!((0.0..0.3).contains(&above), "{above} above {target}");
        }
        assert!(at(reached - 6.0).bytes() < given.bytes.len());
    }

    #[test]
    fn too_much_quality_is_missed_by_the_best_file() {
        let (file, missed) = to_quality(120.0);
        let missed = missed.unwrap();
        assert_eq!((missed.wished, missed.reached), (120.0, quality(&file.encoded.decoded).unwrap()));
        assert_eq!(file.factor, FINEST);
    }
}
