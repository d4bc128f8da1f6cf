//! Nodes that move while training: from where little would change without them to where motion is not explained.
//!
//! What a node cannot explain shows where the loss pulls the Gaussians that follow it apart. For some training views the
//! trainer gives the gradient of the loss by every Gaussian's position. The nodes' own translations explain the weighted mean
//! of it over their Gaussians; a rest remains. A new node at the place of a Gaussian would have known weights, and the sum of
//! the rests by these weights is how the loss would pull it. From the square of its length that is subtracted which it would have
//! if the rests had nothing in common. Where the sum over the views is largest, a node is wanting. SC-GS (Huang et al., CVPR
//! 2024) adds nodes by the norms of the gradients instead.
//!
//! The number of nodes does not change, and a moved node begins with the motion that its new place has already.

use burn::module::Param;
use burn::tensor::{Tensor, TensorData};

use super::placement::{LEAST_RADIUS, square};
use super::plain::{PosesAt, Skinned, Weights};
use super::trajectory::knots_through;
use super::{NodesField, numbers, tensor};
use crate::scene::field::{FinePosition, PositionGradients, Renewed, SceneAtRest};

/// Views whose gradients are looked at.
const VIEWS: usize = 16;
/// A node is moved if taking it away costs less than this share of the mean cost.
const CHEAP: f32 = 0.25;
/// At most so many Gaussians and times give the cost of taking a node away, and so many Gaussians may be the place of one.
const SAMPLED: usize = 1500;
const TIMES: usize = 6;
const CANDIDATES: usize = 500;
/// Smallest logit with which a node counts.
const LEAST_LOGIT: f32 = -6.0;
/// Smallest sum of weights by which a mean is divided.
const LEAST_SUM: f32 = 1e-6;
/// Fewer nodes than this stay where they are.
const FEWEST: usize = 5;

/// A node's new place: that of a Gaussian, and its radius, world units.
struct Wanting {
    gaussian: usize,
    radius: f32,
}

impl NodesField {
    /// How many views [`Self::relocate`] wants to see before an iteration.
    pub(super) fn relocation_views(&self, position: &FinePosition) -> usize {
        let interval = self.config.relocation_interval;
        let due = interval > 0 && position.iteration > 0 && position.iteration.is_multiple_of(interval);
        let last = self.config.relocation_until * position.iterations as f64;
        if due && position.iteration as f64 <= last && self.nodes() >= FEWEST { VIEWS } else { 0 }
    }

    /// Moves some nodes, and says which numbers begin anew.
    pub(super) fn relocate(
        &mut self,
        scene: &SceneAtRest<'_>,
        views: &[PositionGradients],
        position: &FinePosition,
    ) -> Vec<Renewed> {
        if scene.gaussians.is_empty() {
            return Vec::new();
        }
        let skinned = self.plain_numbers(scene);
        let segments = self.knots() - 3;
        let times: Vec<f32> = (0..=segments).map(|end| end as f32 / segments as f32).collect();
        let poses: Vec<PosesAt> = times.iter().map(|time| self.poses_at(*time)).collect();
        let [low, high] = position.window;
        let seen = times.iter().zip(&poses).filter(|(time, _)| (low..=high).contains(*time));
        let seen: Vec<&PosesAt> = seen.map(|(_, poses)| poses).collect();
        let spread: Vec<&PosesAt> = seen.iter().step_by(seen.len().div_ceil(TIMES).max(1)).copied().collect();

        let free = self.dispensable(&skinned, &spread);
        let wanting = self.wanting(&skinned, views, &free, scene.extent);
        let moved: Vec<(usize, Wanting)> = free.into_iter().zip(wanting).collect();
        if moved.is_empty() {
            return Vec::new();
        }
        let nodes: Vec<usize> = moved.iter().map(|(node, _)| *node).collect();
        self.place(&skinned, &poses, &moved);
        self.renewed(&nodes)
    }

    /// Nodes that can be taken away one after the other, the cheapest first.
    fn dispensable(&self, skinned: &Skinned, times: &[&PosesAt]) -> Vec<usize> {
        // One stays: the others' radii are measured from it.
        let most = ((self.config.relocation_share * self.nodes() as f64).ceil() as usize).min(self.nodes() - 1);
        let mut free = Vec::new();
        let mut limit = None;
        while free.len() < most {
            let costs = removal_costs(skinned, times, &free);
            let limit = *limit.get_or_insert(CHEAP * costs.iter().sum::<f32>() / costs.len() as f32);
            let left = (0..self.nodes()).filter(|node| !free.contains(node));
            match left.min_by(|a, b| costs[*a].total_cmp(&costs[*b])) {
                Some(cheapest) if costs[cheapest] <= limit => free.push(cheapest),
                _ => break,
            }
        }
        free
    }

    /// Where nodes are wanting, the most wanted first: as many as there are free ones, or fewer.
    fn wanting(&self, skinned: &Skinned, views: &[PositionGradients], free: &[usize], extent: f32) -> Vec<Wanting> {
        let means = &skinned.means;
        let rows: Vec<(Weights, f32)> =
            (0..means.len()).map(|i| skinned.weights(i, |node| free.contains(&node))).collect();
        let rests: Vec<Vec<[f32; 3]>> =
            views.iter().map(|view| rests(&rows, skinned.nodes(), &view.gradients)).collect();
        let kept = (0..skinned.nodes()).filter(|node| !free.contains(node));
        let mut anchors: Vec<[f32; 3]> = kept.map(|node| skinned.anchors[node]).collect();
        let radius = |place: &[f32; 3], anchors: &[[f32; 3]]| {
            let nearest = anchors.iter().map(|anchor| square(place, anchor)).fold(f32::INFINITY, f32::min);
            (self.config.radius as f32 * nearest.sqrt()).max(LEAST_RADIUS * extent)
        };
        let visible: Vec<usize> =
            (0..means.len()).filter(|i| skinned.opacities[*i] > self.config.opacity as f32).collect();
        let candidates = visible.iter().step_by(visible.len().div_ceil(CANDIDATES).max(1));
        let mut scored: Vec<(f32, usize)> = candidates
            .map(|at| (pull(&means[*at], radius(&means[*at], &anchors), means, &rows, &rests), *at))
            .collect();
        scored.retain(|(pull, _)| *pull > 0.0);
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<Wanting> = Vec::new();
        for (_, gaussian) in scored {
            if chosen.len() == free.len() {
                break;
            }
            let place = &means[gaussian];
            let apart = |other: &Wanting| square(place, &means[other.gaussian]) > (2.0 * other.radius).powi(2);
            if chosen.iter().all(apart) {
                chosen.push(Wanting { gaussian, radius: radius(place, &anchors) });
                anchors.push(*place);
            }
        }
        chosen
    }

    /// Gives nodes the places of Gaussians, and the motion that these have. `poses` are those at the ends of the splines'
    /// segments.
    fn place(&mut self, skinned: &Skinned, poses: &[PosesAt], moved: &[(usize, Wanting)]) {
        let (nodes, knots) = (self.nodes(), self.knots());
        let unit: f32 = self.unit.val().into_scalar();
        let [old_translations, old_rotations] = [&self.translations, &self.rotations].map(|knots| numbers(knots.val()));
        let (mut anchors, mut log_radii) = (numbers(self.anchors.val()), numbers(self.log_radii.val()));
        let (mut translations, mut rotations) = (old_translations.clone(), old_rotations.clone());
        let mut affinities = skinned.of_nodes.clone();
        let mut ways = self.ways.as_ref().map(|ways| numbers(ways.val())).unwrap_or_default();
        for (node, Wanting { gaussian, radius }) in moved {
            let (weights, _) = skinned.weights(*gaussian, |_| false);
            let place = &skinned.means[*gaussian];
            let blend = |knots: &[f32], width: usize, knot: usize, component: usize| -> f32 {
                let moving = weights.iter().filter(|(from, _)| *from < nodes);
                moving.map(|(from, weight)| weight * knots[(knot * nodes + from) * width + component]).sum()
            };
            log_radii[*node] = (radius / unit).ln();
            for axis in 0..3 {
                anchors[3 * node + axis] = place[axis] / unit;
                // Translations blend linearly. What rotations around other anchors add to them is computed at the ends of
                // the segments.
                let own: Vec<f32> = (0..knots).map(|knot| blend(&old_translations, 3, knot, axis)).collect();
                let rest = poses.iter().zip(own.windows(3)).map(|(poses, near)| {
                    let whole = (poses.blended(&weights, place)[axis] - place[axis]) / unit;
                    whole - (near[0] + 4.0 * near[1] + near[2]) / 6.0
                });
                let rest = knots_through(&rest.collect::<Vec<_>>());
                for (knot, (own, rest)) in own.into_iter().zip(rest).enumerate() {
                    translations[(knot * nodes + node) * 3 + axis] = own + rest;
                }
            }
            // It belongs to the object of the node that its place follows most.
            let most = weights.iter().filter(|(from, _)| *from < nodes).max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((from, _)) = most {
                ways.chunks_exact_mut(3 * nodes).for_each(|row| row.copy_within(3 * from..3 * from + 3, 3 * node));
            }
            for at in 0..skinned.affinities {
                affinities[node * skinned.affinities + at] = blend(&skinned.of_nodes, skinned.affinities, 0, at);
            }
            for knot in 0..knots {
                for component in 0..4 {
                    rotations[(knot * nodes + node) * 4 + component] = blend(&old_rotations, 4, knot, component);
                }
            }
        }
        let device = self.device();
        let set = |parameter: &mut Param<Tensor<2>>, values: Vec<f32>| {
            let value = Tensor::from_data(TensorData::new(values, parameter.dims()), &device).require_grad();
            *parameter = Param::initialized(parameter.id, value);
        };
        set(&mut self.anchors, anchors);
        set(&mut self.log_radii, log_radii);
        set(&mut self.translations, translations);
        set(&mut self.rotations, rotations);
        if let Some(parameter) = &mut self.affinities {
            set(parameter, affinities);
        }
        if let Some(parameter) = &mut self.ways {
            *parameter = Param::from_tensor(tensor(ways, parameter.dims(), &device)).set_require_grad(false);
        }
    }

    /// The numbers of some nodes.
    fn renewed(&self, moved: &[usize]) -> Vec<Renewed> {
        let (nodes, knots) = (self.nodes(), self.knots());
        let of = |path: &'static str, rows: usize, width: usize| {
            let places = (0..rows).flat_map(|row| moved.iter().map(move |node| row * nodes + node));
            Renewed { path, elements: places.flat_map(|place| place * width..(place + 1) * width).collect() }
        };
        let affinities = self.affinities.as_ref().map(|all| of("affinities", 1, all.dims()[1]));
        let others =
            [of("anchors", 1, 3), of("log_radii", 1, 1), of("translations", knots, 3), of("rotations", knots, 4)];
        others.into_iter().chain(affinities).collect()
    }
}

/// How far Gaussians are displaced if one more node is taken away, in the sum over Gaussians by their opacities and over
/// times, for each node.
fn removal_costs(skinned: &Skinned, times: &[&PosesAt], free: &[usize]) -> Vec<f32> {
    let mut costs = vec![0.0; skinned.nodes()];
    let stride = skinned.means.len().div_ceil(SAMPLED).max(1);
    for (i, place) in skinned.means.iter().enumerate().step_by(stride) {
        let (weights, _) = skinned.weights(i, |node| free.contains(&node));
        let before: Vec<[f32; 3]> = times.iter().map(|poses| poses.blended(&weights, place)).collect();
        for (node, weight) in weights.iter().filter(|(node, _)| *node < skinned.nodes()) {
            // Where little is left, the weights of the others are computed anew: a difference would be rounding alone.
            let others = (*weight > 0.5).then(|| skinned.weights(i, |other| other == *node || free.contains(&other)).0);
            for (poses, before) in times.iter().zip(&before) {
                let after = match &others {
                    Some(others) => poses.blended(others, place),
                    None => {
                        let own = poses.moved(*node, place);
                        std::array::from_fn(|axis| (before[axis] - weight * own[axis]) / (1.0 - weight))
                    }
                };
                costs[*node] += skinned.opacities[i] * square(before, &after).sqrt();
            }
        }
    }
    costs
}

/// What is left of a view's gradients `[N, 3]` when each Gaussian's share in the means of its nodes is subtracted.
fn rests(rows: &[(Weights, f32)], nodes: usize, gradients: &Tensor<2>) -> Vec<[f32; 3]> {
    let gradients = numbers(gradients.clone());
    let gradients = gradients.as_chunks::<3>().0;
    // Of each node: the sum, and that of the weights.
    let mut sums = vec![([0.0f32; 3], 0.0f32); nodes + 1];
    for ((weights, _), gradient) in rows.iter().zip(gradients) {
        for (node, weight) in weights.iter().filter(|(node, _)| *node < nodes) {
            let (sum, total) = &mut sums[*node];
            (0..3).for_each(|axis| sum[axis] += weight * gradient[axis]);
            *total += weight;
        }
    }
    let mean = |node: usize, axis: usize| sums[node].0[axis] / sums[node].1.max(LEAST_SUM);
    let rest = |((weights, _), gradient): (&(Weights, f32), &[f32; 3])| {
        std::array::from_fn(|axis| {
            gradient[axis] - weights.iter().map(|(node, weight)| weight * mean(*node, axis)).sum::<f32>()
        })
    };
    rows.iter().zip(gradients).map(rest).collect()
}

/// How strongly the loss would pull a node at a place, in the sum over the views.
fn pull(place: &[f32; 3], radius: f32, means: &[[f32; 3]], rows: &[(Weights, f32)], rests: &[Vec<[f32; 3]>]) -> f32 {
    // Of each view: the sum of the rests, and what its square would be if they had nothing in common.
    let mut sums = vec![([0.0f32; 3], 0.0f32); rests.len()];
    let precision = 0.5 / (radius * radius);
    for (i, mean) in means.iter().enumerate() {
        let logit = -precision * square(mean, place) - rows[i].1;
        if logit < LEAST_LOGIT {
            continue;
        }
        let weight = 1.0 / (1.0 + (-logit).exp());
        for ((sum, by_chance), rests) in sums.iter_mut().zip(rests) {
            (0..3).for_each(|axis| sum[axis] += weight * rests[i][axis]);
            *by_chance += weight * weight * square(&rests[i], &[0.0; 3]);
        }
    }
    sums.iter().map(|(sum, by_chance)| (square(sum, &[0.0; 3]) - by_chance).max(0.0).sqrt()).sum()
}
