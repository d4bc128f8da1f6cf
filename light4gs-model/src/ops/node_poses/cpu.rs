//! Control nodes at a time, forward and backward. There are a few hundred at most, so one thread does it.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use glam::{Mat3, Vec3};

use super::motion::{Knots, add_to_knots};
use super::spline::Spline;
use super::{INPUTS, LEARNED, NodePoseKernels, NodeTensors, Posing};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};
use crate::ops::skinning::{PLACE, POSED};

/// The parameters of the nodes; lengths are shares of `unit`.
#[derive(Clone, Copy, Debug)]
struct NodeSlices<'a> {
    /// `[B, 3]`
    anchors: &'a [f32],
    /// `[B, 1]`
    log_radii: &'a [f32],
    knots: Knots<'a>,
    /// `[B, H]`
    affinities: &'a [f32],
    unit: f32,
}

/// Gradients of [`pose_slices`], row by row.
struct NodeGradients {
    anchors: Vec<f32>,
    log_radii: Vec<f32>,
    translations: Vec<f32>,
    rotations: Vec<f32>,
    affinities: Vec<f32>,
}

fn vector(rows: &[f32], row: usize) -> Vec3 {
    Vec3::from_slice(&rows[3 * row..])
}

impl NodeSlices<'_> {
    /// H
    fn affinity_count(&self) -> usize {
        self.affinities.len() / self.knots.nodes
    }

    fn precision(&self, node: usize) -> f32 {
        (-2.0 * self.log_radii[node]).exp() / (2.0 * self.unit * self.unit)
    }

    fn spline(&self, time: f32) -> Spline {
        Spline::at(time, self.knots.count())
    }
}

/// Posed nodes `[B, 20 + H]`.
fn pose_slices(nodes: &NodeSlices, time: f32) -> Vec<f32> {
    let spline = nodes.spline(time);
    let width = nodes.affinity_count();
    let mut posed = Vec::with_capacity(nodes.knots.nodes * (POSED + width));
    for node in 0..nodes.knots.nodes {
        let anchor = vector(nodes.anchors, node);
        let motion = nodes.knots.motion(node, &spline);
        let offset = (anchor + motion.translation - motion.rotation * anchor) * nodes.unit;
        posed.extend((anchor * nodes.unit).to_array());
        posed.push(nodes.precision(node));
        posed.extend(motion.rotation.transpose().to_cols_array());
        posed.extend(offset.to_array());
        posed.extend(motion.quat);
        posed.extend_from_slice(&nodes.affinities[width * node..width * (node + 1)]);
    }
    posed
}

/// Gradients of all parameters but the unit, from `upstream [B, 20 + H]`.
fn pose_backward(nodes: &NodeSlices, time: f32, upstream: &[f32]) -> NodeGradients {
    let spline = nodes.spline(time);
    let count = nodes.knots.nodes;
    let columns = POSED + nodes.affinity_count();
    let mut gradients = NodeGradients {
        anchors: Vec::with_capacity(3 * count),
        log_radii: Vec::with_capacity(count),
        translations: vec![0.0; nodes.knots.translations.len()],
        rotations: vec![0.0; nodes.knots.rotations.len()],
        affinities: Vec::with_capacity(nodes.affinities.len()),
    };
    for (node, row) in upstream.chunks_exact(columns).enumerate() {
        let anchor = vector(nodes.anchors, node);
        let motion = nodes.knots.motion(node, &spline);
        let pose = &row[PLACE..POSED];
        let of_offset = vector(pose, 3) * nodes.unit;
        // offset = anchor + translation - R anchor, times the unit
        let of_matrix = Mat3::from_cols_slice(pose).transpose();
        let outer = Mat3::from_cols(of_offset * anchor.x, of_offset * anchor.y, of_offset * anchor.z);
        let of_quat = [pose[12], pose[13], pose[14], pose[15]];
        let of_turn = motion.turn_backward(of_matrix - outer, of_quat);
        let of_anchor = vector(row, 0) * nodes.unit + of_offset - motion.rotation.transpose() * of_offset;
        gradients.anchors.extend(of_anchor.to_array());
        gradients.log_radii.push(-2.0 * nodes.precision(node) * row[PLACE - 1]);
        add_to_knots(&mut gradients.translations, 3 * count, node, &spline, of_offset.to_array());
        add_to_knots(&mut gradients.rotations, 4 * count, node, &spline, of_turn);
        gradients.affinities.extend_from_slice(&row[POSED..]);
    }
    gradients
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    inputs: [HostTensor; INPUTS],
    nodes: usize,
    posing: Posing,
}

impl CpuSaved {
    fn slices(&self) -> NodeSlices<'_> {
        let [anchors, log_radii, translations, rotations, affinities, unit] =
            self.inputs.each_ref().map(HostTensor::as_slice);
        let affinities = if self.posing.affinities > 0 { affinities } else { &[] };
        let knots = Knots { translations, rotations, nodes: self.nodes };
        NodeSlices { anchors, log_radii, knots, affinities, unit: unit[0] }
    }
}

fn forward_on_cpu<B: HostBackend>(nodes: NodeTensors<B>, posing: Posing) -> (FloatTensor<B>, CpuSaved) {
    let count = nodes.anchors.shape()[0];
    let saved = CpuSaved { inputs: nodes.into_array().map(B::to_host), nodes: count, posing };
    let posed = pose_slices(&saved.slices(), posing.time);
    (B::from_values(posed, [count, POSED + posing.affinities]), saved)
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>) -> [FloatTensor<B>; LEARNED] {
    let upstream = B::to_host(gradient);
    let slices = saved.slices();
    let (nodes, knots) = (saved.nodes, slices.knots.count());
    let gradients = pose_backward(&slices, saved.posing.time, upstream.as_slice());
    [
        B::from_values(gradients.anchors, [nodes, 3]),
        B::from_values(gradients.log_radii, [nodes, 1]),
        B::from_values(gradients.translations, [knots, 3 * nodes]),
        B::from_values(gradients.rotations, [knots, 4 * nodes]),
        B::from_values(gradients.affinities, [nodes, saved.posing.affinities]),
    ]
}

for_cpu_back_ends! {
    NodePoseKernels {
        type Posed = CpuSaved;

        fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(nodes, posing)
        }

        fn node_poses_backward(saved: CpuSaved, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED] {
            backward_on_cpu::<Self>(saved, gradient)
        }
    }
}
