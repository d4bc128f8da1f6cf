// Quaternions (w, x, y, z): rotations from unit ones, and Hamilton's product.

struct Rotation {
    axis_x: vec3<f32>,
    axis_y: vec3<f32>,
    axis_z: vec3<f32>,
}

fn rotation_of(q: vec4<f32>) -> Rotation {
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    return Rotation(
        vec3<f32>(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        vec3<f32>(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        vec3<f32>(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    );
}

fn sum_of_products(a: vec4<f32>, b: vec4<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

// From the gradient of the rotation's columns to that of the given quaternion, before its normalization.
fn rotation_backward(q: vec4<f32>, norm: f32, dx: vec3<f32>, dy: vec3<f32>, dz: vec3<f32>) -> vec4<f32> {
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    let d = vec4<f32>(
        2.0 * (z * (dx.y - dy.x) + y * (dz.x - dx.z) + x * (dy.z - dz.y)),
        2.0 * (y * (dx.y + dy.x) + z * (dx.z + dz.x) + w * (dy.z - dz.y)) - 4.0 * x * (dy.y + dz.z),
        2.0 * (x * (dx.y + dy.x) + z * (dy.z + dz.y) + w * (dz.x - dx.z)) - 4.0 * y * (dx.x + dz.z),
        2.0 * (x * (dx.z + dz.x) + y * (dy.z + dz.y) + w * (dx.y - dy.x)) - 4.0 * z * (dx.x + dy.y),
    );
    return (d - sum_of_products(d, q) * q) / norm;
}

fn hamilton_product(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(
        a.x * b.x - a.y * b.y - a.z * b.z - a.w * b.w,
        a.x * b.y + a.y * b.x + a.z * b.w - a.w * b.z,
        a.x * b.z - a.y * b.w + a.z * b.x + a.w * b.y,
        a.x * b.w + a.y * b.z - a.z * b.y + a.w * b.x,
    );
}
