//! The Gaussians that a take shows: those of the base and those of a segment.

use crate::{GaussianArrays, sh_rest_coefficients};

/// The Gaussians of the base that are not hidden, and then those of the segment, both in their order.
///
/// The spherical harmonics have the larger of the two degrees; those that one of them has not are 0. Further attributes are left
/// out, as base and segment need not have the same. `hidden` has a bit for each Gaussian of the base; what it does not have is
/// drawn.
pub fn drawn_together(base: &GaussianArrays, hidden: &[bool], segment: Option<&GaussianArrays>) -> GaussianArrays {
    let is_hidden = |index: u32| hidden.get(index as usize).copied().unwrap_or(false);
    let base = GaussianArrays { further: Vec::new(), ..base.clone() };
    let visible: Vec<u32> = (0..base.len() as u32).filter(|&index| !is_hidden(index)).collect();
    let mut drawn = if visible.len() == base.len() { base } else { base.gathered(&visible) };
    if let Some(segment) = segment {
        let degree = drawn.sh_degree.max(segment.sh_degree);
        drawn = of_degree(drawn, degree);
        drawn.append(of_degree(GaussianArrays { further: Vec::new(), ..segment.clone() }, degree));
    }
    drawn
}

/// The same Gaussians with spherical harmonics of a degree that is not lower.
fn of_degree(gaussians: GaussianArrays, degree: u8) -> GaussianArrays {
    let (old, new) = (3 * sh_rest_coefficients(gaussians.sh_degree), 3 * sh_rest_coefficients(degree));
    if old == new {
        return gaussians;
    }
    let mut sh_rest = vec![0.0; new * gaussians.len()];
    if old > 0 {
        // Lower degrees come first.
        let rows = sh_rest.chunks_exact_mut(new).zip(gaussians.sh_rest.chunks_exact(old));
        rows.for_each(|(padded, row)| padded[..old].copy_from_slice(row));
    }
    GaussianArrays { sh_degree: degree, sh_rest, ..gaussians }
}
