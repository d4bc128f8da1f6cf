//! Motion as glTF has it: joints on keyframes, and Gaussians that follow some of them by weights (linear blend skinning).

use glam::{Affine3A, Quat, Vec3};
use serde_json::{Map, Value, json};

use super::accessors::{Accessors, Component, OTHER, VERTICES};
use super::conventions::unit_xyzw;
use crate::error::DataError;

/// Joints of a set of weights, as glTF has it.
const SET: usize = 4;
/// Most joints that a Gaussian follows: two sets.
const MOST_INFLUENCES: usize = 2 * SET;
/// A Gaussian follows a second set of joints if the first set has less than this share of its weights.
const LEAST_SHARE: f64 = 0.99;
/// Most joints of a skin: glTF stores their numbers in 16 bits.
const MOST_JOINTS: usize = 1 << 16;

/// Where a joint is at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPose {
    /// World units.
    pub position: [f32; 3],
    /// How it is turned: a quaternion (w, x, y, z) of any length but zero.
    pub rotation: [f32; 4],
}

/// A rigid body that Gaussians follow.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its place at rest, world units; at rest it is not turned.
    pub anchor: [f32; 3],
    /// Its poses, one for each keyframe; none if it never moves.
    pub poses: Vec<JointPose>,
}

impl Joint {
    /// The transformation from rest to `moment`: keyframes since the first one, with fractions between them.
    fn transform(&self, moment: f32) -> Affine3A {
        let last = self.poses.len().saturating_sub(1);
        let at = |keyframe: usize| {
            let JointPose { position, rotation } = self.poses[keyframe.min(last)];
            (Quat::from_array(unit_xyzw(rotation)), Vec3::from_array(position))
        };
        if self.poses.is_empty() {
            return Affine3A::IDENTITY;
        }
        let keyframe = moment.max(0.0).floor();
        let ((rotation, position), (next_rotation, next_position)) = (at(keyframe as usize), at(keyframe as usize + 1));
        let share = (moment - keyframe).clamp(0.0, 1.0);
        let (rotation, position) = (rotation.slerp(next_rotation, share), position.lerp(next_position, share));
        Affine3A::from_rotation_translation(rotation, position)
            * Affine3A::from_translation(-Vec3::from_array(self.anchor))
    }
}

/// The joints that a Gaussian follows, the strongest first. Weights sum to 1; behind the last joint there are zeros.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Influence {
    joints: [u16; MOST_INFLUENCES],
    weights: [f32; MOST_INFLUENCES],
}

impl Influence {
    /// The four largest of the weights of all joints, or the eight largest where four would lose more than 1 %.
    /// `weights[j]` is that of joint `j`; they need not sum to 1.
    ///
    /// ```
    /// use light4gs_data::Influence;
    ///
    /// let influence = Influence::strongest(&[0.0, 0.3, 0.7]);
    /// assert_eq!(influence.iter().collect::<Vec<_>>(), [(2, 0.7), (1, 0.3)]);
    /// ```
    pub fn strongest(weights: &[f32]) -> Self {
        let mut order: Vec<usize> = (0..weights.len().min(MOST_JOINTS)).collect();
        order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]));
        let sum_of = |count: usize| -> f64 { order.iter().take(count).map(|joint| f64::from(weights[*joint])).sum() };
        let one_set = sum_of(SET) >= LEAST_SHARE * sum_of(usize::MAX);
        let count = if one_set { SET } else { MOST_INFLUENCES };
        let sum = sum_of(count);
        let mut influence = Self { joints: [0; MOST_INFLUENCES], weights: [0.0; MOST_INFLUENCES] };
        for (place, joint) in order.into_iter().take(count).enumerate() {
            let weight = (f64::from(weights[joint]) / sum) as f32;
            // glTF wants the number 0 where a joint is not used.
            if weight != 0.0 {
                (influence.joints[place], influence.weights[place]) = (joint as u16, weight);
            }
        }
        influence
    }

    /// Joints and their weights, the strongest first.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let all = self.joints.into_iter().zip(self.weights);
        all.take_while(|(_, weight)| *weight != 0.0).map(|(joint, weight)| (usize::from(joint), weight))
    }
}

/// What moves the Gaussians of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    joints: Vec<Joint>,
    seconds: Vec<f32>,
    influences: Vec<Influence>,
}

impl Skin {
    /// Joints, the times of their keyframes, and for each Gaussian the joints that it follows.
    ///
    /// # Errors
    /// [`DataError::Options`] for no joints or more than 65536, for another number of poses than of keyframes, for times that
    /// do not ascend from 0 or later, and for joints that do not exist.
    pub fn new(joints: Vec<Joint>, seconds: Vec<f32>, influences: Vec<Influence>) -> Result<Self, DataError> {
        let wrong = |option: &'static str, problem: String| Err(DataError::Options { option, problem });
        if joints.is_empty() || joints.len() > MOST_JOINTS {
            return wrong("joints", format!("{} joints, expected 1 to {MOST_JOINTS}", joints.len()));
        }
        let frames = seconds.len();
        let moves_otherwise = |joint: &&Joint| !joint.poses.is_empty() && joint.poses.len() != frames;
        if let Some(joint) = joints.iter().find(moves_otherwise) {
            return wrong(
                "joints",
                format!("{} poses, expected one for each of {frames} keyframes", joint.poses.len()),
            );
        }
        let ascend = seconds.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascend || !seconds.first().is_some_and(|first| *first >= 0.0) {
            return wrong("seconds", "expected one time or more, ascending from 0 or later".to_owned());
        }
        let count = joints.len();
        if let Some((joint, _)) = influences.iter().flat_map(Influence::iter).find(|(joint, _)| *joint >= count) {
            return wrong("influences", format!("joint {joint}, expected less than {count}"));
        }
        Ok(Self { joints, seconds, influences })
    }

    /// Joints.
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Gaussians.
    pub fn gaussians(&self) -> usize {
        self.influences.len()
    }

    /// Time of the last keyframe, seconds.
    pub fn duration(&self) -> f32 {
        self.seconds.last().copied().unwrap_or(0.0)
    }

    /// Keyframes.
    pub fn keyframes(&self) -> usize {
        self.seconds.len()
    }

    /// The centers of the Gaussians at a `moment`, as glTF defines them, from their centers `means` at rest; world
    /// units. `moment` counts keyframes from the first one, with fractions between them.
    pub fn positions(&self, means: &[[f32; 3]], moment: f32) -> Vec<[f32; 3]> {
        let transforms: Vec<Affine3A> = self.joints.iter().map(|joint| joint.transform(moment)).collect();
        let moved = |(mean, influence): (&[f32; 3], &Influence)| {
            let mean = Vec3::from_array(*mean);
            influence.iter().map(|(joint, weight)| transforms[joint].transform_point3(mean) * weight).sum::<Vec3>()
        };
        means.iter().zip(&self.influences).map(|pair| moved(pair).to_array()).collect()
    }

    /// Adds the attributes of the vertices with their joints and weights.
    pub(super) fn add_influences(&self, accessors: &mut Accessors, names: &mut Map<String, Value>) {
        let used = self.influences.iter().map(|influence| influence.iter().count()).max().unwrap_or(0);
        for set in 0..used.div_ceil(SET).max(1) {
            let joints = if self.joints.len() <= 256 {
                self.add_joints(set, accessors, |joint| joint as u8)
            } else {
                self.add_joints(set, accessors, |joint| joint)
            };
            let weights = self.influences.iter().map(|influence| *of_set(&influence.weights, set));
            names.insert(format!("JOINTS_{set}"), json!(joints));
            names.insert(format!("WEIGHTS_{set}"), json!(accessors.add(weights, VERTICES)));
        }
    }

    fn add_joints<T: Component>(&self, set: usize, accessors: &mut Accessors, number: impl Fn(u16) -> T) -> usize {
        let rows = self.influences.iter().map(|influence| of_set(&influence.joints, set).map(&number));
        accessors.add(rows, VERTICES)
    }

    /// Adds joints, skin and animation to a file whose node 0 has the Gaussians.
    ///
    /// A program that skins ignores the transformation of that node, so a common root of the joints has it as well. A joint's
    /// own transformation is that of the first keyframe.
    pub(super) fn add_motion(&self, accessors: &mut Accessors, json: &mut Value) {
        const FIRST: usize = 2;
        let seconds = accessors.add_bounded(self.seconds.iter().map(|second| [*second]), OTHER);
        let (mut nodes, mut samplers, mut channels) = (Vec::new(), Vec::new(), Vec::new());
        for (index, joint) in self.joints.iter().enumerate() {
            let position = |pose: &JointPose| pose.position;
            let rotation = |pose: &JointPose| unit_xyzw(pose.rotation);
            nodes.push(match joint.poses.first() {
                Some(pose) => {
                    json!({"name": format!("joint {index}"), "translation": position(pose), "rotation": rotation(pose)})
                }
                None => json!({"name": "still", "translation": joint.anchor}),
            });
            if joint.poses.is_empty() {
                continue;
            }
            let outputs = [
                ("translation", accessors.add(joint.poses.iter().map(position), OTHER)),
                ("rotation", accessors.add(joint.poses.iter().map(rotation), OTHER)),
            ];
            for (path, output) in outputs {
                channels.push(json!({"sampler": samplers.len(), "target": {"node": FIRST + index, "path": path}}));
                samplers.push(json!({"input": seconds, "output": output, "interpolation": "LINEAR"}));
            }
        }
        let numbers: Vec<usize> = (FIRST..FIRST + nodes.len()).collect();
        let mut root = json!({"name": "joints", "children": numbers});
        if let Some(rotation) = json["nodes"][0].get("rotation") {
            root["rotation"] = rotation.clone();
        }
        // Column by column.
        let to_joint = self.joints.iter().map(|joint| {
            let [x, y, z] = joint.anchor.map(|coordinate| -coordinate);
            [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
        });
        let to_joint = accessors.add(to_joint, OTHER);
        json["nodes"][0]["skin"] = json!(0);
        let own = json["nodes"][0].take();
        json["nodes"] = [own, root].into_iter().chain(nodes).collect();
        json["scenes"][0]["nodes"] = json!([0, 1]);
        json["skins"] = json!([{"joints": numbers, "inverseBindMatrices": to_joint, "skeleton": 1}]);
        if !channels.is_empty() {
            json["animations"] = json!([{"name": "motion", "channels": channels, "samplers": samplers}]);
        }
    }
}

/// The numbers of a set of four.
fn of_set<T>(all: &[T; MOST_INFLUENCES], set: usize) -> &[T; SET] {
    &all.as_chunks().0[set]
}
