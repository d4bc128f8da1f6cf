//! The places of the nodes when motion begins: spread over the visible Gaussians.

use burn::module::Param;

use super::{MOST_NODES, NodesField, affinity, numbers, tensor};
use crate::scene::field::{FinePosition, SceneAtRest};

/// Least radius of a node, as a share of the scene's extent.
const LEAST_RADIUS: f32 = 5e-3;

impl NodesField {
    /// The same with nodes at points of the scene that are far from each other, on trajectories that do not move yet.
    pub(super) fn placed(&self, scene: &SceneAtRest<'_>, position: &FinePosition) -> Self {
        let device = self.device();
        let config = &self.config;
        let unit = scene.extent.max(f32::MIN_POSITIVE);
        let points: Vec<[f32; 3]> =
            self.matter(scene).into_iter().map(|point| point.map(|coordinate| coordinate / unit)).collect();
        let anchors = spread_out(&points, config.count.min(MOST_NODES));
        let radii = distances_to_nearest(&anchors)
            .into_iter()
            .map(|distance| (config.radius as f32 * distance).max(LEAST_RADIUS).ln())
            .collect();
        let nodes = anchors.len();
        let mut placed = Self::zeros(config.clone(), nodes, Self::knots_of(config, position.times), &device);
        placed.anchors = Param::from_tensor(tensor(anchors.concat(), [nodes, 3], &device));
        placed.log_radii = Param::from_tensor(tensor(radii, [nodes, 1], &device));
        if config.affinities > 0 {
            let own = affinity::of_nodes(nodes, config.affinities, position.seed, &device);
            placed.affinities = Some(Param::from_tensor(own));
        }
        placed.unit = Param::from_tensor(placed.unit.val() * unit).set_require_grad(false);
        placed
    }

    /// Positions of visible Gaussians; of the most opaque tenth if few are visible.
    fn matter(&self, scene: &SceneAtRest<'_>) -> Vec<[f32; 3]> {
        let means = numbers(scene.gaussians.means.val());
        let logits = numbers(scene.gaussians.opacity_logits.val());
        let (means, opacity) = (means.as_chunks::<3>().0, self.config.opacity as f32);
        let least = (opacity / (1.0 - opacity)).ln();
        let mut order: Vec<usize> = (0..means.len()).collect();
        order.sort_by(|a, b| logits[*b].total_cmp(&logits[*a]));
        let visible = order.iter().take_while(|at| logits[**at] > least).count();
        let enough = (means.len() / 10).max(2 * self.config.count).min(means.len());
        order.truncate(visible.max(enough));
        order.into_iter().map(|at| means[at]).collect()
    }
}

pub(super) fn square(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// `count` of the points, far from each other: the first is the nearest to the middle, and each next one the farthest from
/// those before.
fn spread_out(points: &[[f32; 3]], count: usize) -> Vec<[f32; 3]> {
    let middle = std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f32>() / points.len() as f32);
    let first = points.iter().min_by(|a, b| square(a, &middle).total_cmp(&square(b, &middle)));
    let mut chosen: Vec<[f32; 3]> = first.copied().into_iter().collect();
    let mut nearest = vec![f32::INFINITY; points.len()];
    while chosen.len() < count.min(points.len()) {
        let last = chosen[chosen.len() - 1];
        nearest.iter_mut().zip(points).for_each(|(nearest, point)| *nearest = nearest.min(square(point, &last)));
        let farthest = points.iter().zip(&nearest).max_by(|(_, a), (_, b)| a.total_cmp(b));
        chosen.extend(farthest.map(|(point, _)| *point));
    }
    chosen
}

/// The distance of each point to the nearest other one; 1 where there is none.
fn distances_to_nearest(points: &[[f32; 3]]) -> Vec<f32> {
    let nearest = |at: usize| {
        let others = points.iter().enumerate().filter(|(other, _)| *other != at);
        others.map(|(_, other)| square(&points[at], other)).reduce(f32::min).map_or(1.0, f32::sqrt)
    };
    (0..points.len()).map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_points_are_far_from_each_other() {
        let points: Vec<[f32; 3]> = (0..101).map(|i| [i as f32 / 100.0, 0.0, 0.0]).collect();
        let chosen = spread_out(&points, 5);
        assert_eq!(chosen[0], [0.5, 0.0, 0.0]);
        let mut places: Vec<f32> = chosen.iter().map(|point| point[0]).collect();
        places.sort_by(f32::total_cmp);
        assert_eq!(places, [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(distances_to_nearest(&chosen), [0.25; 5]);
        assert_eq!(spread_out(&points[..2], 5).len(), 2);
    }
}
