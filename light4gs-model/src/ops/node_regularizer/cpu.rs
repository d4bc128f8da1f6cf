//! The regularizer of control nodes, with its gradients.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::{LEARNED, NodeRegularizerKernels, ROTATIONS, Regularization, RegularizedTensors, VARIANCE};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;
use crate::ops::node_poses::motion::{Knots, NodeMotion, add_to_knots};
use crate::ops::node_poses::spline::Spline;

/// Nodes of a task: one meets all others, which is little work where there are few.
const TASK: usize = 16;

/// The loss, and its gradients row by row.
#[derive(Clone, Debug)]
pub struct Regularized {
    loss: f32,
    /// `[B, 3]`
    anchors: Vec<f32>,
    /// `[K, 3 B]`
    translations: Vec<f32>,
    /// `[K, 4 B]`
    rotations: Vec<f32>,
}

/// A node as its neighbors see it.
struct Node {
    anchor: Vec3,
    /// Where it is at the time.
    place: Vec3,
    motion: NodeMotion,
    /// Of the squared distance, in the exponent of a neighbor's weight.
    sharpness: f32,
}

impl Node {
    /// The weight of a neighbor, its offset from the place where this node expects it, and its offset from this node at
    /// rest.
    fn sees(&self, neighbor: &Node) -> (f32, Vec3, Vec3) {
        let before = neighbor.anchor - self.anchor;
        let weight = (before.length_squared() * self.sharpness).exp();
        (weight, neighbor.place - self.place - self.motion.rotation * before, before)
    }
}

/// Sums over the neighbors of one node, of losses that are not yet divided by the sum of the weights.
#[derive(Clone, Copy, Default)]
struct Sums {
    strain: f32,
    weight: f32,
    of_anchor: Vec3,
    of_translation: Vec3,
    of_turn: [f32; 4],
}

/// The sums of the terms in which a node expects a neighbor somewhere, and of those in which a neighbor expects the node.
fn strain_of(own: &Node, all: &[Node]) -> Sums {
    let mut sums = Sums::default();
    let mut of_rotation = Mat3::ZERO;
    for other in all {
        let (weight, off, before) = own.sees(other);
        sums.strain += weight * off.length_squared();
        sums.weight += weight;
        let by_off = 2.0 * weight * off;
        sums.of_translation -= by_off;
        sums.of_anchor += own.motion.rotation.transpose() * by_off;
        of_rotation -= Mat3::from_cols(by_off * before.x, by_off * before.y, by_off * before.z);
        let (weight, off, _) = other.sees(own);
        let by_off = 2.0 * weight * off;
        sums.of_translation += by_off;
        sums.of_anchor -= other.motion.rotation.transpose() * by_off;
    }
    sums.of_anchor += sums.of_translation;
    sums.of_turn = own.motion.turn_backward(of_rotation, [0.0; 4]);
    sums
}

/// The mean squared second difference of knots, and its gradients times `scale`, which are added.
fn bend(knots: &[f32], columns: usize, scale: f32, gradients: &mut [f32]) -> f32 {
    let differences = knots.len() - 2 * columns;
    let mut sum = 0.0;
    for at in 0..differences {
        let [first, middle, last] = [at, at + columns, at + 2 * columns];
        let second = knots[first] - 2.0 * knots[middle] + knots[last];
        sum += second * second;
        let by_second = 2.0 * scale / differences as f32 * second;
        gradients[first] += by_second;
        gradients[middle] -= 2.0 * by_second;
        gradients[last] += by_second;
    }
    sum / differences as f32
}

/// See [`regularize`](super::regularize). Anchors are `[B, 3]`, logarithms of radii `[B, 1]`.
fn regularize_slices(anchors: &[f32], log_radii: &[f32], knots: Knots, regularization: &Regularization) -> Regularized {
    let Regularization { rigidity, smoothness, time } = *regularization;
    let spline = Spline::at(time, knots.count());
    let node = |node: usize| {
        let anchor = Vec3::from_slice(&anchors[3 * node..]);
        let motion = knots.motion(node, &spline);
        let sharpness = (-2.0 * log_radii[node]).exp() * (-0.5 / VARIANCE);
        Node { anchor, place: anchor + motion.translation, motion, sharpness }
    };
    let nodes: Vec<Node> = (0..knots.nodes).map(node).collect();
    let sums: Vec<Sums> = nodes.par_iter().with_min_len(TASK).map(|own| strain_of(own, &nodes)).collect();
    let of_all = |part: fn(&Sums) -> f32| sums.iter().map(part).sum::<f32>();
    let (strain, weight) = (of_all(|sums| sums.strain), of_all(|sums| sums.weight));

    let mut regularized = Regularized {
        loss: 0.0,
        anchors: Vec::with_capacity(anchors.len()),
        translations: vec![0.0; knots.translations.len()],
        rotations: vec![0.0; knots.rotations.len()],
    };
    let [of_translations, of_rotations] = [3, 4].map(|numbers| numbers * knots.nodes);
    let bends = [
        bend(knots.translations, of_translations, smoothness, &mut regularized.translations),
        ROTATIONS * bend(knots.rotations, of_rotations, smoothness * ROTATIONS, &mut regularized.rotations),
    ];
    let scale = rigidity / weight;
    regularized.loss = smoothness * (bends[0] + bends[1]) + scale * strain;
    for (node, sums) in sums.iter().enumerate() {
        regularized.anchors.extend((scale * sums.of_anchor).to_array());
        let of_translation = (scale * sums.of_translation).to_array();
        add_to_knots(&mut regularized.translations, of_translations, node, &spline, of_translation);
        let of_turn = sums.of_turn.map(|gradient| scale * gradient);
        add_to_knots(&mut regularized.rotations, of_rotations, node, &spline, of_turn);
    }
    regularized
}

fn forward_on_cpu<B: HostBackend>(
    nodes: RegularizedTensors<B>,
    regularization: &Regularization,
) -> (FloatTensor<B>, Arc<Regularized>) {
    let count = nodes.anchors.shape()[0];
    let inputs = nodes.into_array().map(B::to_host);
    let [anchors, translations, rotations, log_radii] = inputs.each_ref().map(|input| input.as_slice());
    let knots = Knots { translations, rotations, nodes: count };
    let regularized = regularize_slices(anchors, log_radii, knots, regularization);
    (B::from_values(vec![regularized.loss], [1]), Arc::new(regularized))
}

fn backward_on_cpu<B: HostBackend>(regularized: &Regularized, gradient: FloatTensor<B>) -> [FloatTensor<B>; LEARNED] {
    let scale = B::to_host(gradient).as_slice()[0];
    let scaled = |values: &[f32], rows: usize| {
        let columns = values.len() / rows;
        B::from_values(values.iter().map(|value| scale * value).collect(), [rows, columns])
    };
    let nodes = regularized.anchors.len() / 3;
    let knots = regularized.translations.len() / (3 * nodes);
    let Regularized { anchors, translations, rotations, .. } = regularized;
    [scaled(anchors, nodes), scaled(translations, knots), scaled(rotations, knots)]
}

for_cpu_back_ends! {
    NodeRegularizerKernels {
        type Derivatives = Arc<Regularized>;

        fn node_regularizer_forward(
            nodes: RegularizedTensors<Self>,
            regularization: Regularization,
        ) -> (FloatTensor<Self>, Arc<Regularized>) {
            forward_on_cpu(nodes, &regularization)
        }

        fn node_regularizer_backward(
            derivatives: Arc<Regularized>,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; LEARNED] {
            backward_on_cpu::<Self>(&derivatives, gradient)
        }
    }
}
