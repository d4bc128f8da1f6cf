//! The Gaussians that a take shows: those of the base and those of its segments.

use super::fade::faded;
use crate::{GaussianArrays, sh_rest_coefficients};

/// What a segment shows at a time.
#[derive(Clone, Copy, Debug)]
pub struct SegmentPart<'a> {
    /// For each Gaussian of the base, whether the segment hides it; what the list does not have is drawn.
    pub hidden: &'a [bool],
    /// The segment's own Gaussians, at the time.
    pub moved: &'a GaussianArrays,
    /// Its share, as of [`DrawnSegment::weight`](super::DrawnSegment::weight).
    pub weight: f32,
}

/// The Gaussians of the base that not all segments hide, and then those of each segment, all in their order.
///
/// With a weight `w` that is not 1, an opacity `o` becomes `1 - (1 - o)^w`. A Gaussian of the base that one of two segments
/// hides has the weight of the other one. The spherical harmonics have the largest of the degrees; those that a part has not are
/// 0. Further attributes are left out, as the parts need not have the same.
pub fn drawn_together(base: &GaussianArrays, segments: &[SegmentPart<'_>]) -> GaussianArrays {
    let shown = |part: &SegmentPart<'_>, index: usize| !part.hidden.get(index).copied().unwrap_or(false);
    let mut drawn = GaussianArrays { further: Vec::new(), ..base.clone() };
    if segments.iter().any(|part| !part.hidden.is_empty()) {
        let mut visible = Vec::new();
        for (index, logit) in drawn.opacity_logits.iter_mut().enumerate() {
            let mut weights = segments.iter().filter(|part| shown(part, index)).map(|part| part.weight);
            match (weights.next(), weights.next()) {
                (None, _) => continue,
                (Some(weight), None) => *logit = faded(*logit, weight),
                // Shown by all: there are at most two.
                (Some(_), Some(_)) => {}
            }
            visible.push(index as u32);
        }
        drawn = drawn.gathered(&visible);
    }
    let degree = segments.iter().map(|part| part.moved.sh_degree).fold(drawn.sh_degree, u8::max);
    drawn = of_degree(drawn, degree);
    for part in segments {
        let mut moved = of_degree(GaussianArrays { further: Vec::new(), ..part.moved.clone() }, degree);
        moved.opacity_logits.iter_mut().for_each(|logit| *logit = faded(*logit, part.weight));
        drawn.append(moved);
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
