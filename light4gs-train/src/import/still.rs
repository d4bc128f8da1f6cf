//! Plain Gaussians from a PLY file in the layout of the original 3DGS.

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::attributes::typical_size;
use light4gs_codec::{GaussianArrays, sh_rest_coefficients};
use light4gs_data::{DataError, GaussianPly};
use light4gs_model::{DynamicScene, Gaussians, Pca, SceneCoordinates, StillField};

use super::bounds::bound;
use super::extent::Extent;
use crate::error::TrainError;

/// Degree up to which a [`GaussianPly`] is padded.
const FULL_DEGREE: u8 = 3;
/// Where the typical Gaussian is a larger share of the scene's radius than this, the step of the positions does not grow with
/// it.
const LARGEST: f64 = 0.1;
/// A [`StillScene::step_share`] below this is worth a word.
const SUSPICIOUS: f64 = 1e-2;

/// Plain Gaussians from a file.
#[derive(Debug)]
pub struct StillScene {
    /// The Gaussians, with the highest degree of harmonics that any of them uses.
    pub scene: DynamicScene<StillField>,
    /// What was changed or left out, one sentence each.
    pub notes: Vec<String>,
    /// The step of the positions, in units of the typical Gaussian as the configuration's is, should be this share of the
    /// usual one: below 1 where the Gaussians are so large that the usual step would move all of them into one point.
    pub step_share: f64,
}

/// Reads Gaussians that do not move. Values that would cost all others their precision are bounded.
///
/// # Errors
/// As [`GaussianPly::read`]; a file without Gaussians.
pub fn read(path: &Path, device: &Device) -> Result<StillScene, TrainError> {
    let (mut gaussians, left_out) = read_gaussians(path)?;
    let mut notes = bound(&mut gaussians);
    if !left_out.is_empty() {
        notes.push(format!("left out, since 3DGS does not have it: {}", left_out.join(", ")));
    }
    let gaussians = with_used_degree(gaussians);
    let step_share = step_share(&gaussians);
    if step_share < SUSPICIOUS {
        notes.push(format!(
            "the typical Gaussian is {:.0} times as large as the scene; if that is not meant: the layout has the natural \
             logarithms of scales",
            LARGEST / step_share
        ));
    }
    let pca = Pca::fit(&gaussians.means);
    let scene = DynamicScene {
        gaussians: Gaussians::from_arrays(&gaussians, device),
        coordinates: SceneCoordinates::new(&pca, device),
        field: StillField,
        differentiate_points: false,
    }
    .no_grad();
    Ok(StillScene { scene, notes, step_share })
}

/// See [`StillScene::step_share`].
fn step_share(gaussians: &GaussianArrays) -> f64 {
    let (of_means, typical) = (Extent::of(gaussians).of_means, f64::from(typical_size(&gaussians.log_scales)));
    if of_means > 0.0 && typical > 0.0 { (LARGEST * of_means / typical).min(1.0) } else { 1.0 }
}

/// Gaussians of degree 3, in which coefficients that the file lacks are 0; and the names of further properties.
pub(super) fn read_gaussians(path: &Path) -> Result<(GaussianArrays, Vec<String>), DataError> {
    let GaussianPly { means, sh_dc, sh_rest, opacity_logits, log_scales, quats, further } = GaussianPly::read(path)?;
    if means.is_empty() {
        return Err(DataError::ply(path, "it holds no Gaussians", "export the scene again"));
    }
    let sh_rest = sh_rest.into_iter().flatten().flatten().collect();
    let left_out = further.into_iter().map(|(name, _)| name.escape_debug().to_string()).collect();
    let further = Vec::new();
    let sh_degree = FULL_DEGREE;
    Ok((GaussianArrays { means, log_scales, quats, opacity_logits, sh_dc, sh_degree, sh_rest, further }, left_out))
}

/// Removes the degrees in which every coefficient of every Gaussian is 0.
fn with_used_degree(mut gaussians: GaussianArrays) -> GaussianArrays {
    let row = 3 * sh_rest_coefficients(FULL_DEGREE);
    let used = |coefficient: &usize| gaussians.sh_rest.iter().skip(*coefficient).step_by(row).any(|v| *v != 0.0);
    let highest = (0..row).rev().find(used).map_or(0, |coefficient| coefficient / 3 + 1);
    let degree = (0..=FULL_DEGREE).find(|degree| sh_rest_coefficients(*degree) >= highest).unwrap_or(FULL_DEGREE);
    let kept = 3 * sh_rest_coefficients(degree);
    gaussians.sh_rest = gaussians.sh_rest.chunks_exact(row).flat_map(|row| row[..kept].to_vec()).collect();
    gaussians.sh_degree = degree;
    gaussians
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_degree_is_the_one_that_is_used() {
        for (last, degree) in
            [(None, 0), (Some(0), 1), (Some(2), 1), (Some(3), 2), (Some(7), 2), (Some(8), 3), (Some(14), 3)]
        {
            let mut sh_rest = vec![0.0; 2 * 45];
            if let Some(coefficient) = last {
                sh_rest[45 + 3 * coefficient + 1] = 0.5;
            }
            let arrays = GaussianArrays { sh_degree: 3, sh_rest, ..GaussianArrays::default() };
            let found = with_used_degree(arrays);
            assert_eq!(found.sh_degree, degree);
            assert_eq!(found.sh_rest.len(), 2 * 3 * sh_rest_coefficients(degree));
            assert_eq!(found.sh_rest.iter().filter(|value| **value == 0.5).count(), usize::from(last.is_some()));
        }
    }
}
