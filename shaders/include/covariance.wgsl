// Values of the EWA projection that both directions need (Zwicker et al. 2001): from a Gaussian to the factor of its 2D
// covariance.

struct Geometry {
    // In camera coordinates.
    position: vec3<f32>,
    quat: vec4<f32>,
    quat_norm: f32,
    rotation: Rotation,
    scale: vec3<f32>,
    // Rows of J · W · R · S: the covariance is their Gram matrix.
    factor_x: vec3<f32>,
    factor_y: vec3<f32>,
    // Rows of J · W.
    row_x: vec3<f32>,
    row_y: vec3<f32>,
    // x/z and y/z, clamped, and whether each was clamped.
    slope: vec2<f32>,
    slope_clamped: vec2<bool>,
}

// Rows of the rotation from world to camera.
fn world_row(axis: u32) -> vec3<f32> {
    return vec3<f32>(view.axis_x[axis], view.axis_y[axis], view.axis_z[axis]);
}

fn to_camera(mean: vec3<f32>) -> vec3<f32> {
    return view.axis_x.xyz * mean.x + view.axis_y.xyz * mean.y + view.axis_z.xyz * mean.z + view.translation.xyz;
}

fn factor_of(rotation: Rotation, row: vec3<f32>, scale: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot3(rotation.axis_x, row), dot3(rotation.axis_y, row), dot3(rotation.axis_z, row)) * scale;
}

fn geometry_of(mean: vec3<f32>, raw_quat: vec4<f32>, scale: vec3<f32>) -> Geometry {
    var g: Geometry;
    g.position = to_camera(mean);
    g.quat_norm = sqrt(sum_of_products(raw_quat, raw_quat));
    g.quat = raw_quat / g.quat_norm;
    g.rotation = rotation_of(g.quat);
    g.scale = scale;
    let z = g.position.z;
    let free = g.position.xy / z;
    g.slope = clamp(free, view.slopes.xy, view.slopes.zw);
    g.slope_clamped = g.slope != free;
    let forward = world_row(2u);
    g.row_x = (view.axis_x.w / z) * (world_row(0u) - g.slope.x * forward);
    g.row_y = (view.axis_y.w / z) * (world_row(1u) - g.slope.y * forward);
    g.factor_x = factor_of(g.rotation, g.row_x, scale);
    g.factor_y = factor_of(g.rotation, g.row_y, scale);
    return g;
}

// Zero where there is no direction.
fn direction_of(offset: vec3<f32>) -> vec3<f32> {
    let reciprocal = 1.0 / sqrt(dot3(offset, offset));
    if (is_finite(reciprocal) && reciprocal > 0.0) {
        return offset * reciprocal;
    }
    return vec3<f32>(0.0);
}
