//! The motion of control nodes as other programs have it: joints, keyframes and weights.

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
    /// Keyframes a second.
    pub(super) fps: f64,
}

impl NodesMotion<'_> {
    /// The time of a keyframe, in [0, 1]; with fractions between keyframes.
    fn time(&self, keyframe: f32) -> f32 {
        if self.keyframes == 1 { 0.0 } else { keyframe / (self.keyframes - 1) as f32 }
    }

    /// A joint for each node, and one that never moves if Gaussians may stand still.
    ///
    /// # Errors
    /// A rate at which keyframes do not follow each other.
    pub(super) fn skin(&self) -> Result<Skin, TrainError> {
        let joint = |anchor| Joint { anchor, poses: Vec::new() };
        let mut joints: Vec<Joint> = rows(self.nodes.world_anchors()).into_iter().map(joint).collect();
        for keyframe in 0..self.keyframes {
            let time = self.scene.coordinates.field_time(self.time(keyframe as f32));
            let (places, quats) = self.nodes.places(time);
            let poses = rows(places).into_iter().zip(rows(quats));
            for (joint, (position, rotation)) in joints.iter_mut().zip(poses) {
                joint.poses.push(JointPose { position, rotation });
            }
        }
        let stands_still = self.scene.gaussians.tensors().further(STILLNESS).is_some();
        joints.extend(stands_still.then(|| joint([0.0; 3])));
        let seconds = (0..self.keyframes).map(|keyframe| (f64::from(keyframe) / self.fps) as f32).collect();
        Ok(Skin::new(joints, seconds, self.influences(stands_still))?)
    }

    fn influences(&self, stands_still: bool) -> Vec<Influence> {
        let (count, nodes) = (self.scene.gaussians.len(), self.nodes.nodes());
        let mut influences = Vec::with_capacity(count);
        for first in (0..count).step_by(ROWS) {
            let canonical = self.scene.gaussians.tensors().rows(first..count.min(first + ROWS));
            let weights: Vec<f32> = self.nodes.weights(&canonical).into_data().iter().collect();
            let used = nodes + usize::from(stands_still);
            influences.extend(weights.chunks_exact(nodes + 1).map(|row| Influence::strongest(&row[..used])));
        }
        influences
    }

    /// The distances between the Gaussians of a skin and those of the scene, at the keyframes and halfway between them.
    pub(super) fn distances(&self, skin: &Skin) -> Distances {
        let at_rest = rows(self.scene.gaussians.means.val());
        let moments = 2 * self.keyframes - 1;
        let (mut sum, mut largest) = (0.0, 0.0_f64);
        for half in 0..moments {
            let moment = half as f32 / 2.0;
            let exact: Vec<[f32; 3]> = rows(self.scene.at(self.time(moment)).means);
            for (found, exact) in skin.positions(&at_rest, moment).into_iter().zip(exact) {
                let square: f32 = found.iter().zip(exact).map(|(found, exact)| (found - exact).powi(2)).sum();
                let distance = f64::from(square).sqrt();
                sum += distance;
                largest = largest.max(distance);
            }
        }
        Distances { mean: sum / (f64::from(moments) * at_rest.len().max(1) as f64), largest }
    }
}

/// World units.
pub(super) struct Distances {
    pub(super) mean: f64,
    pub(super) largest: f64,
}

fn rows<const N: usize>(tensor: Tensor<2>) -> Vec<[f32; N]> {
    let values: Vec<f32> = tensor.into_data().iter().collect();
    values.as_chunks().0.to_vec()
}
