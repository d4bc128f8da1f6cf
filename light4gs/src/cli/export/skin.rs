//! The motion of control nodes as other programs have it: joints, keyframes and weights.

use std::fmt;

use burn::tensor::Tensor;
use light4gs_data::{Influence, Joint, JointPose, Skin};
use light4gs_model::{DynamicScene, NodesField, STILLNESS};
use light4gs_train::error::TrainError;

/// Gaussians whose weights of all nodes are in memory at once.
const ROWS: usize = 1 << 14;

/// A scene that control nodes move, and the rate of its samples.
pub(super) struct NodesMotion<'a> {
    pub(super) scene: &'a DynamicScene,
    /// The scene's own.
    pub(super) nodes: &'a NodesField,
    pub(super) keyframes: u32,
    /// Keyframes per second.
    pub(super) fps: f64,
    /// The time of a keyframe, in [0, 1]; with fractions between keyframes.
    pub(super) time: &'a dyn Fn(f32) -> f32,
    /// Gaussians of the file before those of the scene, which never move.
    pub(super) standing: usize,
}

impl NodesMotion<'_> {
    /// A joint for each node, and one that never moves if Gaussians may stand still.
    ///
    /// # Errors
    /// A rate at which keyframes do not follow each other.
    pub(super) fn skin(&self) -> Result<Skin, TrainError> {
        let joint = |anchor| Joint { anchor, poses: Vec::new() };
        let mut joints: Vec<Joint> = rows(self.nodes.world_anchors()).into_iter().map(joint).collect();
        for keyframe in 0..self.keyframes {
            let time = self.scene.coordinates.field_time((self.time)(keyframe as f32));
            let (places, quats) = self.nodes.places(time);
            let poses = rows(places).into_iter().zip(rows(quats));
            for (joint, (position, rotation)) in joints.iter_mut().zip(poses) {
                joint.poses.push(JointPose { position, rotation });
            }
        }
        let have_stillness = self.scene.gaussians.tensors().further(STILLNESS).is_some();
        let some_stand = have_stillness || self.standing > 0;
        joints.extend(some_stand.then(|| joint([0.0; 3])));
        let seconds = (0..self.keyframes).map(|keyframe| (f64::from(keyframe) / self.fps) as f32).collect();
        Ok(Skin::new(joints, seconds, self.influences(have_stillness))?)
    }

    fn influences(&self, have_stillness: bool) -> Vec<Influence> {
        let (count, nodes) = (self.scene.gaussians.len(), self.nodes.nodes());
        let mut influences = Vec::with_capacity(self.standing + count);
        if self.standing > 0 {
            // The joint after those of the nodes.
            let weights: Vec<f32> = (0..=nodes).map(|joint| if joint == nodes { 1.0 } else { 0.0 }).collect();
            influences.resize(self.standing, Influence::strongest(&weights));
        }
        for first in (0..count).step_by(ROWS) {
            let canonical = self.scene.gaussians.tensors().rows(first..count.min(first + ROWS));
            let weights: Vec<f32> = self.nodes.weights(&canonical).into_data().iter().collect();
            let used = nodes + usize::from(have_stillness);
            influences.extend(weights.chunks_exact(nodes + 1).map(|row| Influence::strongest(&row[..used])));
        }
        influences
    }

    /// The distances between the Gaussians of a skin and those of the scene, at the keyframes and halfway between them.
    pub(super) fn add_distances(&self, skin: &Skin, distances: &mut Distances) {
        let mut at_rest = vec![[0.0; 3]; self.standing];
        at_rest.extend(rows::<3>(self.scene.gaussians.means.val()));
        for half in 0..2 * self.keyframes - 1 {
            let moment = half as f32 / 2.0;
            let exact: Vec<[f32; 3]> = rows(self.scene.at((self.time)(moment)).means);
            let found = skin.positions(&at_rest, moment).into_iter().skip(self.standing);
            for (found, exact) in found.zip(exact) {
                let square: f32 = found.iter().zip(exact).map(|(found, exact)| (found - exact).powi(2)).sum();
                distances.add(f64::from(square).sqrt());
            }
        }
    }
}

/// How far centers are from where they should be, world units.
#[derive(Debug, Default)]
pub(super) struct Distances {
    sum: f64,
    count: u64,
    largest: f64,
}

impl Distances {
    fn add(&mut self, distance: f64) {
        self.sum += distance;
        self.count += 1;
        self.largest = self.largest.max(distance);
    }
}

impl fmt::Display for Distances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mean = self.sum / self.count.max(1) as f64;
        write!(f, "centers are off by {mean:.5} in the mean, by {:.5} at most", self.largest)
    }
}

fn rows<const N: usize>(tensor: Tensor<2>) -> Vec<[f32; N]> {
    let values: Vec<f32> = tensor.into_data().iter().collect();
    values.as_chunks().0.to_vec()
}
