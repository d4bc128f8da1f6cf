//! Exact nearest neighbors: the mean squared distance to the three nearest points.
//!
//! A small k-d tree of our own. The crates that exist either need few equal coordinates along an axis (unlike point
//! clouds on a plane, or with duplicates), or need their own types.

use rayon::prelude::*;

/// Smallest mean squared distance that is reported, so that its logarithm stays usable.
pub const SMALLEST_MEAN_SQUARED_DISTANCE: f32 = 1e-7;

/// Points of a leaf are searched one by one.
const LEAF: usize = 16;

/// For each point the mean of the squared distances to its three nearest other points, world
/// units squared, at least [`SMALLEST_MEAN_SQUARED_DISTANCE`].
///
/// `positions` is `[N, 3]`; the result has `N` values. With fewer than four points the mean is over those that there
/// are. Points that coincide are neighbors at distance 0. For non-finite positions the results are unspecified, without
/// a panic.
pub fn mean_squared_distance_to_3_nearest(positions: &[[f32; 3]]) -> Vec<f32> {
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    arrange(positions, &mut order, 0);
    let mut means = vec![0.0f32; positions.len()];
    means.par_iter_mut().enumerate().for_each(|(i, mean)| {
        let mut best = [f32::INFINITY; 3];
        search(positions, &order, 0, i as u32, &mut best);
        let found = best.iter().filter(|d| d.is_finite()).count().max(1);
        let sum: f32 = best.iter().filter(|d| d.is_finite()).sum();
        *mean = (sum / found as f32).max(SMALLEST_MEAN_SQUARED_DISTANCE);
    });
    means
}

/// Orders indices as a balanced tree: the middle of a range divides it along `axis`.
fn arrange(points: &[[f32; 3]], order: &mut [u32], axis: usize) {
    if order.len() <= LEAF {
        return;
    }
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
    });
    let (low, high) = order.split_at_mut(middle);
    let next = (axis + 1) % 3;
    rayon::join(|| arrange(points, low, next), || arrange(points, &mut high[1..], next));
}

/// Keeps the three smallest squared distances from point `query` to the other points of a range.
fn search(points: &[[f32; 3]], order: &[u32], axis: usize, query: u32, best: &mut [f32; 3]) {
    let from = points[query as usize];
    let mut offer = |candidate: u32| {
        if candidate == query {
            return;
        }
        let to = points[candidate as usize];
        let distance: f32 = (0..3).map(|k| (from[k] - to[k]) * (from[k] - to[k])).sum();
        if distance < best[2] {
            best[2] = distance;
            best.sort_unstable_by(f32::total_cmp);
        }
    };
    if order.len() <= LEAF {
        order.iter().for_each(|&candidate| offer(candidate));
        return;
    }
    let middle = order.len() / 2;
    offer(order[middle]);
    let side = from[axis] - points[order[middle] as usize][axis];
    let (low, high) = (&order[..middle], &order[middle + 1..]);
    let (near, far) = if side < 0.0 { (low, high) } else { (high, low) };
    let next = (axis + 1) % 3;
    search(points, near, next, query, best);
    if side * side < best[2] {
        search(points, far, next, query, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    fn brute_force(points: &[[f32; 3]]) -> Vec<f32> {
        (0..points.len())
            .map(|i| {
                let mut all: Vec<f32> = (0..points.len())
                    .filter(|&j| j != i)
                    .map(|j| (0..3).map(|k| (points[i][k] - points[j][k]).powi(2)).sum::<f32>())
                    .collect();
                all.sort_by(f32::total_cmp);
                all.truncate(3);
                (all.iter().sum::<f32>() / all.len().max(1) as f32).max(SMALLEST_MEAN_SQUARED_DISTANCE)
            })
            .collect()
    }

    #[test]
    fn agrees_with_brute_force_also_on_planes_and_duplicates() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for kind in 0..4 {
            for count in [1, 2, 3, 4, 17, 600] {
                let points: Vec<[f32; 3]> = (0..count)
                    .map(|_| match kind {
                        0 => [0; 3].map(|_| rng.random_range(-1.3f32..1.3)),
                        1 => [0.5, rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)],
                        2 => [0; 3].map(|_| rng.random_range(0..3) as f32),
                        _ => [1.0, 2.0, 3.0],
                    })
                    .collect();
                let found = mean_squared_distance_to_3_nearest(&points);
                for (a, b) in found.iter().zip(brute_force(&points)) {
                    assert!((a - b).abs() <= 1e-6 * b.max(1e-3), "{kind} {count} {a} {b}");
                }
            }
        }
        assert!(mean_squared_distance_to_3_nearest(&[]).is_empty());
    }
}
