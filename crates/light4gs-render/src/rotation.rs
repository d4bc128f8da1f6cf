//! Rotations of unit quaternions (w, x, y, z), and their gradients with respect to a quaternion of any length.

use glam::{Mat3, Vec3};

/// The rotation of a unit quaternion.
pub fn rotation_matrix([w, x, y, z]: [f32; 4]) -> Mat3 {
    Mat3::from_cols(
        Vec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        Vec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        Vec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}

/// From the gradient of a rotation to that of its unit quaternion.
pub fn rotation_backward([w, x, y, z]: [f32; 4], gradient: Mat3) -> [f32; 4] {
    let (dx, dy, dz) = (gradient.x_axis, gradient.y_axis, gradient.z_axis);
    [
        2.0 * (z * (dx.y - dy.x) + y * (dz.x - dx.z) + x * (dy.z - dz.y)),
        2.0 * (y * (dx.y + dy.x) + z * (dx.z + dz.x) + w * (dy.z - dz.y)) - 4.0 * x * (dy.y + dz.z),
        2.0 * (x * (dx.y + dy.x) + z * (dy.z + dz.y) + w * (dz.x - dx.z)) - 4.0 * y * (dx.x + dz.z),
        2.0 * (x * (dx.z + dz.x) + y * (dy.z + dz.y) + w * (dx.y - dy.x)) - 4.0 * z * (dx.x + dy.y),
    ]
}

/// From the gradient of a unit quaternion to that of the quaternion of length `norm` that it was made from.
pub fn normalization_backward(unit: [f32; 4], norm: f32, gradient: [f32; 4]) -> [f32; 4] {
    let along: f32 = (0..4).map(|k| gradient[k] * unit[k]).sum();
    std::array::from_fn(|k| (gradient[k] - along * unit[k]) / norm)
}
