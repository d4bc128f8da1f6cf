// The pose of a node, or the blended one of a Gaussian.

struct Pose {
    // Rows of the matrix, each with its component of the offset.
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    // The quaternion.
    turn: vec4<f32>,
}

fn position_in(pose: Pose, mean: vec3<f32>) -> vec3<f32> {
    let place = vec4<f32>(mean, 1.0);
    return vec3<f32>(dot(pose.row_x, place), dot(pose.row_y, place), dot(pose.row_z, place));
}

// What a Gaussian hands to the nodes: itself, and derivatives by what it becomes.
struct Turning {
    mean: vec3<f32>,
    by_position: vec3<f32>,
    by_turn: vec4<f32>,
}

fn row_product(row: vec4<f32>, own: Turning) -> f32 {
    return fma(row.x, own.mean.x, fma(row.y, own.mean.y, fma(row.z, own.mean.z, row.w)));
}

// The product of a pose with the derivatives by the blended one. Where one weight is 1, the blended pose is that node's own, and the
// difference of their products has to be exactly 0: Adam would take a step along any rounding error. So every product that can be is in
// an `fma`, as in `exponent_between`.
fn inner_product(pose: Pose, own: Turning) -> f32 {
    let x = row_product(pose.row_x, own);
    let y = row_product(pose.row_y, own);
    let z = row_product(pose.row_z, own);
    let of_turn = fma(own.by_turn.x, pose.turn.x, fma(own.by_turn.y, pose.turn.y,
        fma(own.by_turn.z, pose.turn.z, own.by_turn.w * pose.turn.w)));
    return fma(own.by_position.x, x, fma(own.by_position.y, y, fma(own.by_position.z, z, of_turn)));
}
