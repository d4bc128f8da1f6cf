//! Poses: a small rotation and translation of a camera, and their derivative through the Gaussians.
//!
//! The splatter has no derivative with respect to its camera, and needs none. The camera that draws is the corrected one. A
//! further small turn of it is a turn of the Gaussians the other way, whose means and quaternions do have derivatives. That
//! turn is 0 in value, so the image is exactly that of the corrected camera.

use burn::tensor::{Device, Tensor, TensorData};
use glam::{Mat3, Quat, Vec3};
use light4gs_data::Camera;
use light4gs_model::GaussianTensors;
use serde::Serialize;

/// Largest turn of a camera, radians.
const MOST_TURN: f32 = 0.2;

/// A correction of a camera, in its own axes (OpenCV): a point that it sees at `x` is at `R x + t`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Pose {
    /// The rotation R as axis times angle, radians.
    pub rotation: [f32; 3],
    /// The translation t, world units.
    pub translation: [f32; 3],
}

impl Pose {
    /// From its six numbers.
    pub(super) fn of(values: [f32; 6]) -> Self {
        let [a, b, c, x, y, z] = values;
        Self { rotation: [a, b, c], translation: [x, y, z] }
    }

    fn turn(&self) -> Mat3 {
        Mat3::from_quat(Quat::from_scaled_axis(self.rotation.into()))
    }

    /// A camera with this correction.
    pub fn corrected(&self, camera: &Camera) -> Camera {
        let turn = self.turn();
        let translation = turn * camera.translation + Vec3::from(self.translation);
        Camera { rotation: turn * camera.rotation, translation, ..*camera }
    }

    /// The gradient with respect to the six numbers, from that with respect to a further turn and translation of the
    /// corrected camera, which [`turned`] gives. They differ for the rotation, since rotations do not commute.
    pub(super) fn gradient(&self, further: [f32; 6]) -> [f32; 6] {
        let [a, b, c, x, y, z] = further;
        let (turn, gradient) = (Vec3::from(self.rotation), Vec3::new(a, b, c));
        // The transpose of the exponential map's left Jacobian; the series is exact in float32 for turns of at most 0.2.
        let square = turn.length_squared();
        let [first, second] = [0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0];
        let once = turn.cross(gradient);
        let gradient = gradient - first * once + second * turn.cross(once);
        [gradient.x, gradient.y, gradient.z, x, y, z]
    }
}

/// The six numbers within what a correction may be; `extent` is that of the scene, world units.
pub(super) fn bounded(values: [f32; 6], extent: f32) -> [f32; 6] {
    let Pose { rotation, translation } = Pose::of(values);
    let rotation = Vec3::from(rotation).clamp_length_max(MOST_TURN);
    let translation = Vec3::from(translation).clamp_length_max(MOST_TURN * extent);
    [rotation.x, rotation.y, rotation.z, translation.x, translation.y, translation.z]
}

/// The Gaussians after `further [6]`, a small turn and translation of the camera in its own axes, whose value is 0: the same
/// Gaussians, with the derivative. `camera` is the corrected one, and `center` is where it was before its correction.
///
/// The derivative leaves out that the colors of the spherical harmonics turn with the camera, which is smaller than the
/// motion on the screen by about the focal length in pixels.
pub(super) fn turned(
    gaussians: GaussianTensors,
    further: &Tensor<1>,
    camera: &Camera,
    center: [f32; 3],
) -> GaussianTensors {
    let device = gaussians.means.device();
    let part = |from: usize| further.clone().slice(from..from + 3).reshape([1, 3]);
    let center = Tensor::<1>::from_floats(center, &device).reshape([1, 3]);
    let (turn, shift) = (part(0), part(3));
    let rotation = camera.rotation;
    // A turn of the camera about its center by `w` is one of the Gaussians, with `w` in world axes: x + w × (x - center).
    let cross = turn.clone().matmul(in_world_axes(rotation, cross_matrix, &device)).reshape([3, 3]);
    let product = turn.matmul(in_world_axes(rotation, quaternion_matrix, &device)).reshape([4, 4]);
    let shift = shift.matmul(in_world_axes(rotation, |axis| axis.to_array(), &device));
    let means = gaussians.means;
    GaussianTensors {
        means: means.clone() + (means - center).matmul(cross) + shift,
        quats: gaussians.quats.clone() + gaussians.quats.matmul(product),
        ..gaussians
    }
}

/// `[3, N]`: what `of` gives for each axis of a camera, in world axes. `of` is linear, so a vector `[1, 3]` in the camera's
/// axes times this is what `of` gives for the vector.
fn in_world_axes<const N: usize>(rotation: Mat3, of: impl Fn(Vec3) -> [f32; N], device: &Device) -> Tensor<2> {
    let rows: Vec<f32> = [0, 1, 2].into_iter().flat_map(|axis| of(rotation.row(axis))).collect();
    Tensor::from_data(TensorData::new(rows, [3, N]), device)
}

/// The matrix by which a row vector is multiplied on its right to get `w × x`, row by row.
fn cross_matrix(w: Vec3) -> [f32; 9] {
    [0.0, w.z, -w.y, -w.z, 0.0, w.x, w.y, -w.x, 0.0]
}

/// The same for the quaternion `(0, w) / 2` times a quaternion (w, x, y, z).
fn quaternion_matrix(w: Vec3) -> [f32; 16] {
    let [x, y, z] = (0.5 * w).to_array();
    [0.0, x, y, z, -x, 0.0, z, -y, -y, -z, 0.0, x, -z, y, -x, 0.0]
}

/// Removes what images do not tell, or tell too weakly to be learned: what moves all cameras together as a rigid body (a mean
/// turn about the middle of the cameras, and a mean translation), and a common scale about that middle. A scene that grows
/// with its cameras looks the same; only its background and the first Gaussians hold it, and a rig was seen to drift.
pub(super) fn without_common_motion(values: &mut [[f32; 6]], cameras: &[Camera]) {
    let poses: Vec<Pose> = values.iter().map(|values| Pose::of(*values)).collect();
    let mean = |of: &dyn Fn(&Pose, &Camera) -> Vec3| {
        poses.iter().zip(cameras).map(|(pose, camera)| of(pose, camera)).sum::<Vec3>() / poses.len() as f32
    };
    // In world axes. To first order a camera's center moves against its translation.
    let moved = |pose: &Pose, camera: &Camera| -(camera.rotation.transpose() * Vec3::from(pose.translation));
    let turn = mean(&|pose, camera| camera.rotation.transpose() * Vec3::from(pose.rotation));
    let shift = mean(&moved);
    let middle = mean(&|_, camera| camera.center());
    // Least squares, where cameras are not all in one place.
    let along = mean(&|pose, camera| Vec3::splat(moved(pose, camera).dot(camera.center() - middle))).x;
    let spread = mean(&|_, camera| Vec3::splat(camera.center().distance_squared(middle))).x;
    let growth = if spread > 0.0 { along / spread } else { 0.0 };
    for (values, camera) in values.iter_mut().zip(cameras) {
        let [a, b, c] = (camera.rotation * turn).to_array();
        let from_middle = camera.center() - middle;
        // Turned by -turn, cameras go round the middle.
        let moved = shift - turn.cross(from_middle) + growth * from_middle;
        let [x, y, z] = (camera.rotation * moved).to_array();
        for (value, change) in values.iter_mut().zip([-a, -b, -c, x, y, z]) {
            *value += change;
        }
    }
}
