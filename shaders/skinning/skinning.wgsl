// Linear blend skinning: positions and rotations of the Gaussians after the nodes have moved.
//
// One invocation owns one Gaussian and meets all nodes twice: first for the largest exponent, then for the blended pose. Reads
// Gaussians and nodes. Writes to `moved` positions [N, 3] and quaternions [N, 4]. Saves five vectors of `blended` for the backward pass:
//
//   0, 1, 2: rows of the blended matrix, each with its component of the blended offset
//   3: the blended quaternion
//   4: the largest exponent; the inverse of the sum of the weights; the weight of the node that stands still

// #include exponential, quaternion, pose, node

struct Parameters {
    count: u32,
    nodes: u32,
    // Where the moved quaternions begin.
    quats: u32,
}

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> stillness: array<f32>;
@group(0) @binding(3) var<storage, read_write> affinities: array<f32>;
@group(0) @binding(4) var<storage, read_write> nodes: array<f32>;
@group(0) @binding(5) var<storage, read_write> moved: array<f32>;
@group(0) @binding(6) var<storage, read_write> blended: array<vec4<f32>>;
@group(0) @binding(7) var<uniform> parameters: Parameters;

fn exponent_of(mean: vec3<f32>, i: u32, node: u32) -> f32 {
    return exponent_between(i, node, squared_length(mean - anchor_of(node)));
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.count) {
        return;
    }
    let mean = vec3<f32>(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
    let own_stillness = stillness[i];
    var largest = own_stillness;
    for (var node = 0u; node < parameters.nodes; node++) {
        largest = max(largest, exponent_of(mean, i, node));
    }
    let still = exponential(own_stillness - largest);
    var sum = still;
    var pose = Pose(
        vec4<f32>(still, 0.0, 0.0, 0.0),
        vec4<f32>(0.0, still, 0.0, 0.0),
        vec4<f32>(0.0, 0.0, still, 0.0),
        vec4<f32>(still, 0.0, 0.0, 0.0),
    );
    for (var node = 0u; node < parameters.nodes; node++) {
        let weight = exponential(exponent_of(mean, i, node) - largest);
        let of_node = pose_of(node);
        sum += weight;
        pose.row_x += weight * of_node.row_x;
        pose.row_y += weight * of_node.row_y;
        pose.row_z += weight * of_node.row_z;
        pose.turn += weight * of_node.turn;
    }
    let inverse_sum = 1.0 / sum;
    pose.row_x *= inverse_sum;
    pose.row_y *= inverse_sum;
    pose.row_z *= inverse_sum;
    pose.turn *= inverse_sum;

    let quat = vec4<f32>(quats[4u * i], quats[4u * i + 1u], quats[4u * i + 2u], quats[4u * i + 3u]);
    let position = position_in(pose, mean);
    let turned = hamilton_product(pose.turn, quat);
    for (var k = 0u; k < 3u; k++) {
        moved[3u * i + k] = position[k];
    }
    for (var k = 0u; k < 4u; k++) {
        moved[parameters.quats + 4u * i + k] = turned[k];
    }
    blended[5u * i] = pose.row_x;
    blended[5u * i + 1u] = pose.row_y;
    blended[5u * i + 2u] = pose.row_z;
    blended[5u * i + 3u] = pose.turn;
    blended[5u * i + 4u] = vec4<f32>(largest, inverse_sum, still * inverse_sum, 0.0);
}
