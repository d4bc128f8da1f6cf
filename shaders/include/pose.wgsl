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

fn vector_in(pose: Pose, vector: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(pose.row_x.xyz, vector), dot(pose.row_y.xyz, vector), dot(pose.row_z.xyz, vector));
}

// What a Gaussian hands to the nodes: itself, and derivatives by what it becomes.
struct Turning {
    mean: vec3<f32>,
    vector: vec3<f32>,
    by_position: vec3<f32>,
    by_vector: vec3<f32>,
    by_turn: vec4<f32>,
}

// The product of a pose with the derivatives by the blended one. Where one weight is 1, the blended pose is that node's own, and the
// difference of their products has to be exactly 0: Adam would take a step along any rounding error.
fn inner_product(pose: Pose, own: Turning) -> f32 {
    let of_place = dot(own.by_position, position_in(pose, own.mean));
    return of_place + dot(own.by_vector, vector_in(pose, own.vector)) + dot(own.by_turn, pose.turn);
}
