//! Levels of detail: fewer, larger Gaussians in place of those of a scene, for images that must be made quickly.
//!
//! The method is stochastic simplification (Cook, Halstead, Planck and Ryu, 2007). A Gaussian is kept with a
//! probability `p` in proportion to its significance, at most 1, and a kept one gets `1 / p` times its area. So the
//! expected area times opacity stays the same, and Gaussians that cover much are not changed at all. The choice is
//! systematic along a Morton curve: of neighbors that are dropped together, about one in `1 / p` stays and covers the
//! others.

use light4gs_codec::attributes::CodingOrder;
use light4gs_codec::rendering::MIN_ALPHA;
use light4gs_codec::{GaussianArrays, MotionEvaluator, MotionOutput};

use crate::gaussians::{opacity, scales};

/// A level of fewer Gaussians is not worth its memory.
const FEWEST: usize = 3000;
/// Each level has half of the Gaussians of the one before.
const MOST_LEVELS: u32 = 5;
/// Further times at which the significance is computed. There are few, since each takes as long as an image of all
/// Gaussians.
const TIMES: [f32; 2] = [0.5, 1.0];

/// The Gaussians of a level.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Selection {
    /// Gaussians of the scene, ascending.
    pub(crate) indices: Vec<u32>,
    /// Factors of their areas.
    pub(crate) growth: Vec<f32>,
}

/// The number of levels, besides the scene itself, of a scene with `count` Gaussians.
pub(crate) fn levels(count: usize) -> u32 {
    (1..=MOST_LEVELS).take_while(|&level| count >> level >= FEWEST).count() as u32
}

/// The largest significance of each Gaussian: among the canonical one, the one `moved` to some time, and those at
/// [`TIMES`]. (Its opacity may be high at some times only.)
pub(crate) fn most_significance(
    canonical: &GaussianArrays,
    moved: &GaussianArrays,
    evaluator: &MotionEvaluator,
) -> Vec<f32> {
    let both = |index: usize| significance(canonical, index).max(significance(moved, index));
    let mut most: Vec<f32> = (0..canonical.len()).map(both).collect();
    if evaluator.changes(MotionOutput::OpacityLogit) || evaluator.changes(MotionOutput::LogScale) {
        let mut moved = canonical.clone();
        for time in TIMES {
            evaluator.apply(canonical, time, 0..canonical.len(), &mut moved);
            most.iter_mut().enumerate().for_each(|(index, most)| *most = most.max(significance(&moved, index)));
        }
    }
    most
}

/// Chooses about `count` Gaussians, given their centers and their significance.
pub(crate) fn select(centers: &[[f32; 3]], significance: &[f32], count: usize) -> Selection {
    let threshold = threshold(significance, count);
    let mut growth_of = vec![0.0; centers.len()];
    let mut sum = 0.5;
    for index in along_curve(centers) {
        let significance = f64::from(significance[index as usize]);
        let probability = if significance < threshold { significance / threshold } else { 1.0 };
        let before = f64::floor(sum);
        sum += probability;
        if significance > 0.0 && f64::floor(sum) > before {
            growth_of[index as usize] = (1.0 / probability) as f32;
        }
    }
    let (indices, growth) = (0..).zip(growth_of).filter(|&(_, growth)| growth > 0.0).unzip();
    Selection { indices, growth }
}

/// Opacity times the mean of the projected area over all directions, up to a factor: by Cauchy's formula that area is a
/// quarter of the surface of a convex body, here of a box. 0 for Gaussians that no view shows.
fn significance(gaussians: &GaussianArrays, index: usize) -> f32 {
    let opacity = opacity(gaussians.opacity_logits[index]);
    let [a, b, c] = scales(gaussians.log_scales[index]);
    let significance = opacity * (a * b + b * c + c * a);
    if opacity >= MIN_ALPHA && significance.is_finite() { significance } else { 0.0 }
}

/// The threshold `t` with `sum(min(1, significance / t)) = count`: Gaussians above it are kept for certain. 0 if there
/// are at most `count` Gaussians.
fn threshold(significance: &[f32], count: usize) -> f64 {
    let (mut threshold, mut certain) = (f64::INFINITY, 0);
    loop {
        let below = significance.iter().map(|&value| f64::from(value)).filter(|&value| value < threshold);
        let rest: f64 = below.sum();
        if certain >= count || rest == 0.0 {
            return 0.0;
        }
        // Falls from step to step: what is above it is above the next one too.
        threshold = rest / (count - certain) as f64;
        let found = significance.iter().filter(|&&value| f64::from(value) >= threshold).count();
        if found <= certain {
            return threshold;
        }
        certain = found;
    }
}

/// The indices of points in the order of a Morton curve; as they are, where one is not finite.
fn along_curve(points: &[[f32; 3]]) -> Vec<u32> {
    // The smallest step stands for the finest grid that there is.
    let order = CodingOrder::new(points, f32::MIN_POSITIVE);
    order.map_or_else(|_| (0..points.len() as u32).collect(), |order| order.rows().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use light4gs_codec::SceneData;

    /// Round Gaussians at the corners of small squares, some large among many small ones.
    fn gaussians(count: usize) -> GaussianArrays {
        let scale = |index: usize| if index.is_multiple_of(50) { 0.5_f32 } else { 0.01 + 1e-4 * (index % 37) as f32 };
        GaussianArrays {
            means: (0..count).map(|index| [(index % 97) as f32, (index / 97) as f32, (index % 5) as f32]).collect(),
            log_scales: (0..count).map(|index| [scale(index).ln(); 3]).collect(),
            quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: (0..count).map(|index| (index % 7) as f32 - 3.0).collect(),
            sh_dc: vec![[0.0; 3]; count],
            ..GaussianArrays::default()
        }
    }

    fn chosen(all: &GaussianArrays, count: usize) -> Selection {
        let still = MotionEvaluator::new(&SceneData::default()).expect("a scene without motion");
        select(&all.means, &most_significance(all, all, &still), count)
    }

    fn total(gaussians: &GaussianArrays) -> f64 {
        (0..gaussians.len()).map(|index| f64::from(significance(gaussians, index))).sum()
    }

    #[test]
    fn a_scene_has_levels_as_long_as_some_thousands_remain() {
        assert_eq!([0, 5999, 6000, 6415, 100_000, 10_000_000].map(levels), [0, 0, 1, 1, 5, 5]);
    }

    #[test]
    fn the_whole_covers_as_much_as_before() {
        let all = gaussians(20_000);
        for level in 1..=3 {
            let Selection { indices, growth } = chosen(&all, all.len() >> level);
            let covered: f64 = indices
                .iter()
                .zip(&growth)
                .map(|(&index, &growth)| f64::from(significance(&all, index as usize) * growth))
                .sum();
            assert!((covered / total(&all) - 1.0).abs() < 1e-3, "{covered} of {}", total(&all));
            assert!(indices.len().abs_diff(all.len() >> level) <= 1, "{} Gaussians", indices.len());
            assert!(indices.is_sorted_by(|a, b| a < b) && growth.iter().all(|&growth| growth >= 1.0));
        }
    }

    /// So that no part of the scene becomes thinner than another.
    #[test]
    fn each_part_covers_as_much_as_before() {
        let all = gaussians(20_000);
        let Selection { indices, growth } = chosen(&all, 5000);
        let halves = [0, 1].map(|half| {
            let here = |index: usize| usize::from(all.means[index][1] >= 100.0) == half;
            let before: f64 =
                (0..all.len()).filter(|&index| here(index)).map(|index| f64::from(significance(&all, index))).sum();
            let kept = indices.iter().zip(&growth).filter(|(index, _)| here(**index as usize));
            let after: f64 = kept.map(|(&index, &growth)| f64::from(significance(&all, index as usize) * growth)).sum();
            after / before
        });
        assert!(halves.iter().all(|share| (share - 1.0).abs() < 0.02), "{halves:?}");
    }

    #[test]
    fn what_covers_most_stays_as_it_is() {
        let all = gaussians(20_000);
        let Selection { indices, growth } = chosen(&all, 2500);
        let mut order: Vec<u32> = (0..all.len() as u32).collect();
        order.sort_by(|&a, &b| significance(&all, b as usize).total_cmp(&significance(&all, a as usize)));
        // The large ones are 400; those of the lowest opacity among them cover least.
        for index in &order[..300] {
            let place = indices.binary_search(index).expect("a large one was dropped");
            assert_eq!(growth[place], 1.0);
        }
    }

    #[test]
    fn what_no_view_shows_is_dropped() {
        let mut all = gaussians(8000);
        all.opacity_logits[3] = -9.0;
        all.log_scales[7] = [f32::NEG_INFINITY; 3];
        all.means[11] = [f32::NAN, f32::INFINITY, 0.0];
        let Selection { indices, .. } = chosen(&all, 7900);
        assert!(!indices.contains(&3) && !indices.contains(&7));
        assert_eq!(chosen(&GaussianArrays::default(), 0), Selection::default());
        // Fewer than are asked for can be seen.
        all.opacity_logits[10..].fill(-9.0);
        let Selection { indices, growth } = chosen(&all, 4000);
        assert!(indices == [0, 1, 2, 4, 5, 6, 8, 9] && growth == [1.0; 8], "{} of 8", indices.len());
    }

    #[test]
    fn neighbors_on_the_curve_are_neighbors_in_space() {
        let points: Vec<[f32; 3]> = [2.0, 0.0, 3.0, 1.0].map(|x| [x, 0.0, -x]).to_vec();
        assert_eq!(along_curve(&points), [1, 3, 0, 2]);
    }
}
