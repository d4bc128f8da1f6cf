//! A file of at most so many bytes (`compression.target_bytes`): the steps of all attributes become coarser or finer by one
//! factor.
//!
//! Learned steps are such that a bit more costs the same everywhere. One factor for all keeps that balance.

use light4gs_codec::{CodecError, CompressionInput, Encoded, SceneData, ShCoding, checks, encode_compressed};

use crate::error::TrainError;

/// Steps become finer by at most this factor: beyond it, more bytes show nothing.
const FINEST: f32 = 0.25;
/// Steps become coarser by at most this factor: beyond it, nothing can be recognized.
const COARSEST: f32 = 16.0;
/// The search is over when the file fills this share of the bytes.
const FILLED: f64 = 0.98;
/// Files that are tried: the factor is then known to 0.1 %.
const TRIES: usize = 12;

/// A file, and how it was made.
pub(super) struct SizedFile {
    /// By how much steps are coarser than the given ones.
    pub(super) factor: f32,
    /// The input with these steps.
    pub(super) input: CompressionInput,
    /// The file.
    pub(super) encoded: Encoded,
}

/// The largest file of at most `target` bytes.
///
/// # Errors
/// What the codec refuses, and a scene that takes more bytes even with the coarsest steps.
pub(super) fn encode_to_size(
    data: &SceneData,
    given: &CompressionInput,
    target: usize,
) -> Result<SizedFile, TrainError> {
    let file = |factor: f32| -> Result<SizedFile, CodecError> {
        let input = with_steps_scaled(given, factor);
        Ok(SizedFile { factor, encoded: encode_compressed(data, &input)?, input })
    };
    let mut found: Option<SizedFile> = None;
    // Files are too large at the first, and small enough at the second.
    let (mut fine, mut coarse) = (FINEST.ln(), COARSEST.ln());
    let mut at = 0.0_f32;
    for _ in 0..TRIES {
        match file(at.exp()) {
            Ok(file) if file.encoded.bytes.len() <= target => {
                coarse = at;
                let bytes = file.encoded.bytes.len();
                if found.as_ref().is_none_or(|found| found.encoded.bytes.len() < bytes) {
                    found = Some(file);
                }
                if bytes as f64 >= FILLED * target as f64 {
                    break;
                }
            }
            Ok(_) => fine = at,
            // Values may be legal with the given steps, and too many of the finer ones.
            Err(_) if at < 0.0 => fine = at,
            Err(problem) => return Err(problem.into()),
        }
        at = 0.5 * (fine + coarse);
    }
    found.ok_or(()).or_else(|()| {
        let smallest = file(COARSEST)?;
        match smallest.encoded.bytes.len() {
            bytes if bytes <= target => Ok(smallest),
            bytes => Err(TrainError::Input(format!(
                "compression.target_bytes is {target}, but this scene takes {bytes} bytes with the coarsest steps. Allow more \
                 bytes, or train fewer Gaussians (train.prune.fraction, train.densify.adaptive.max_gaussians)"
            ))),
        }
    })
}

/// The input with coarser steps of attributes and spherical harmonics. Planes stay as they are: their models know their steps.
fn with_steps_scaled(given: &CompressionInput, factor: f32) -> CompressionInput {
    let mut input = given.clone();
    let steps = given.attributes.iter().map(|(name, step)| (name.to_owned(), step * factor));
    input.attributes = steps.fold(given.attributes.clone(), |all, (name, step)| all.with(&name, step)).clamped();
    if let ShCoding::Channels { step } = &mut input.sh {
        *step = checks::nearest_sh_step(*step * factor);
    }
    input
}

#[cfg(test)]
mod tests {
    use light4gs_codec::attributes::AttributeSteps;
    use light4gs_codec::{GaussianLayers, Profile, WeightPrecisions};

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

    #[test]
    fn a_file_fills_the_bytes_that_it_may_have() {
        let given = encode_compressed(&scene(), &input()).unwrap().bytes.len();
        for target in [given, given * 2 / 3, given * 5 / 4] {
            let file = encode_to_size(&scene(), &input(), target).unwrap();
            let bytes = file.encoded.bytes.len();
            assert!(bytes <= target && bytes as f64 >= 0.95 * target as f64, "{bytes} of {target}");
            assert_eq!(file.factor > 1.0, target < given, "{target}");
        }
    }

    #[test]
    fn too_few_bytes_are_refused() {
        let problem = encode_to_size(&scene(), &input(), 300).err().unwrap().to_string();
        assert!(problem.contains("compression.target_bytes is 300, but this scene takes"), "{problem}");
    }
}
