//! Plain Gaussians from a PLY file in the layout of the original 3DGS.

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::{GaussianArrays, sh_rest_coefficients};
use light4gs_data::{DataError, GaussianPly};
use light4gs_model::{DynamicScene, Gaussians, Pca, SceneCoordinates, StillField};

use crate::error::TrainError;

/// Degree up to which a [`GaussianPly`] is padded.
const FULL_DEGREE: u8 = 3;

/// Reads Gaussians that do not move, with the highest degree of harmonics that any of them uses; and the names of
/// properties that are left out, since 3DGS does not have them.
///
/// # Errors
/// As [`GaussianPly::read`]; a file without Gaussians.
pub fn read(path: &Path, device: &Device) -> Result<(DynamicScene<StillField>, Vec<String>), TrainError> {
    let (gaussians, left_out) = read_gaussians(path)?;
    let gaussians = with_used_degree(gaussians);
    let pca = Pca::fit(&gaussians.means);
    let scene = DynamicScene {
        gaussians: Gaussians::from_arrays(&gaussians, device),
        coordinates: SceneCoordinates::new(&pca, device),
        field: StillField,
        differentiate_points: false,
    }
    .no_grad();
    Ok((scene, left_out))
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
