//! Translation and rotation of a control node at a time, and their gradients by the knots.

use glam::{Mat3, Vec3};
use light4gs_render::rotation::{normalization_backward, rotation_backward, rotation_matrix};

use super::spline::Spline;

/// Knots of all nodes' trajectories.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Knots<'a> {
    /// `[K, 3 B]`
    pub(crate) translations: &'a [f32],
    /// `[K, 4 B]`
    pub(crate) rotations: &'a [f32],
    /// B
    pub(crate) nodes: usize,
}

/// One node at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeMotion {
    pub(crate) translation: Vec3,
    /// A unit quaternion (w, x, y, z).
    pub(crate) quat: [f32; 4],
    /// The length that it had.
    norm: f32,
    pub(crate) rotation: Mat3,
}

impl Knots<'_> {
    /// K
    pub(crate) fn count(&self) -> usize {
        self.translations.len() / (3 * self.nodes)
    }

    pub(crate) fn motion(&self, node: usize, spline: &Spline) -> NodeMotion {
        let raw: [f32; 4] = at(self.rotations, 4 * self.nodes, 4 * node, spline);
        let raw = [raw[0] + 1.0, raw[1], raw[2], raw[3]];
        let norm = raw.iter().map(|q| q * q).sum::<f32>().sqrt();
        let quat = raw.map(|q| q / norm);
        let translation = Vec3::from_array(at(self.translations, 3 * self.nodes, 3 * node, spline));
        NodeMotion { translation, quat, norm, rotation: rotation_matrix(quat) }
    }
}

/// Columns `first..first + C` of the spline through knots `[K, columns]`.
fn at<const C: usize>(knots: &[f32], columns: usize, first: usize, spline: &Spline) -> [f32; C] {
    let mut sums = [0.0; C];
    for (k, weight) in spline.weights.iter().enumerate() {
        let row = (spline.first + k) * columns + first;
        sums.iter_mut().zip(&knots[row..row + C]).for_each(|(sum, knot)| *sum += weight * knot);
    }
    sums
}

impl NodeMotion {
    /// From the gradients of the rotation and of the unit quaternion to that of the spline of the rotations.
    pub(crate) fn turn_backward(&self, of_rotation: Mat3, of_quat: [f32; 4]) -> [f32; 4] {
        let through = rotation_backward(self.quat, of_rotation);
        normalization_backward(self.quat, self.norm, std::array::from_fn(|k| of_quat[k] + through[k]))
    }
}

/// Passes the `gradient` of the spline at one node on to those of its knots `[K, columns]`: adds it to them.
pub(crate) fn add_to_knots<const C: usize>(
    of_knots: &mut [f32],
    columns: usize,
    node: usize,
    spline: &Spline,
    gradient: [f32; C],
) {
    for (k, weight) in spline.weights.iter().enumerate() {
        let row = (spline.first + k) * columns + C * node;
        of_knots[row..row + C].iter_mut().zip(gradient).for_each(|(sum, gradient)| *sum += weight * gradient);
    }
}
