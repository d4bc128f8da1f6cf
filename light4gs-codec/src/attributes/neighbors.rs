//! For each Gaussian, the nearest ones of those that a decoder already has.

use crate::{parallel, vectors::vectorized};

/// How many neighbors a Gaussian has.
pub const NEIGHBORS: usize = 4;
/// How far back in Morton order they are searched. Most Gaussians that are near in space are near in this order.
const WINDOW: usize = 64;

/// For each point the indices of the nearest points before it, as [`nearest_before`] finds them.
pub(crate) fn all_nearest_before(points: &[[f64; 3]]) -> Vec<[u32; NEIGHBORS]> {
    parallel::map(points.len(), |index| nearest_before(points, index))
}

/// The indices of the nearest points before one, nearest first; of two equally near ones, the later first.
///
/// The first point has no neighbors: it gets its own index, which the caller must expect. The next few points repeat
/// their nearest neighbor. Points that are not a finite distance away are no neighbors; where all are, it is the one before. A distance is a sum of rounded squares in a fixed order, so all machines agree.
pub(super) fn nearest_before(points: &[[f64; 3]], index: usize) -> [u32; NEIGHBORS] {
    let point = points[index];
    let first = index.saturating_sub(WINDOW);
    let mut distances = [0.0; WINDOW];
    vectorized(
        #[inline(always)]
        || {
            for (distance, other) in distances.iter_mut().zip(&points[first..index]) {
                let [x, y, z] = [0, 1, 2].map(|axis| point[axis] - other[axis]);
                *distance = x * x + y * y + z * z;
            }
        },
    );
    let mut nearest = [(f64::INFINITY, index); NEIGHBORS];
    for candidate in distances[..index - first].iter().copied().zip(first..index).rev() {
        if candidate.0 < nearest[NEIGHBORS - 1].0 {
            let place = nearest.partition_point(|kept| kept.0 <= candidate.0);
            nearest[place..].rotate_right(1);
            nearest[place] = candidate;
        }
    }
    // Points from a stream may be anywhere, even nowhere.
    let first = if nearest[0].0 == f64::INFINITY { index.saturating_sub(1) } else { nearest[0].1 };
    nearest.map(|(distance, other)| if distance == f64::INFINITY { first } else { other } as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_come_before() {
        let points = [[0, 0, 0], [9, 0, 0], [1, 0, 0], [1, 0, 0], [8, 0, 0], [0, 0, 1]].map(|cell| cell.map(f64::from));
        let expected = [[0; 4], [0; 4], [0, 1, 0, 0], [2, 0, 1, 2], [1, 3, 2, 0], [0, 3, 2, 4]];
        assert_eq!(all_nearest_before(&points), expected);
        assert_eq!(all_nearest_before(&[]), [[0; 4]; 0]);
    }

    /// A decoder has nothing but what comes before.
    #[test]
    fn neighbors_come_before_even_if_positions_are_no_numbers() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::from(f32::MAX), 0.0];
        let points: Vec<_> = (0..200).map(|i| [odd[i % 5], odd[i / 5 % 5], odd[i / 25 % 5]]).collect();
        for (index, near) in all_nearest_before(&points).into_iter().enumerate() {
            assert!(near.iter().all(|&other| (other as usize) < index.max(1)), "{index}: {near:?}");
        }
    }
}
