// First of the parts of skinning's derivative: the gradients of the Gaussians, and what they hand to the nodes.
//
// One invocation owns one Gaussian. Reads it, its blended pose (see `skinning.wgsl`) and `upstream` [N, 7]. Writes the gradients of
// mean, quaternion and stillness, and four vectors of `handed`:
//
//   0: upstream gradient of the position; the inner product of the blended pose with the derivatives by it
//   1: derivative by the blended quaternion
//   2: mean; the largest exponent
//   3: the inverse of the sum of the weights

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> blended: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(4) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> of_means: array<f32>;
@group(0) @binding(6) var<storage, read_write> of_quats: array<f32>;
@group(0) @binding(7) var<storage, read_write> of_stillness: array<f32>;
@group(0) @binding(8) var<uniform> parameters: Parameters;

fn conjugate(q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(q.x, -q.y, -q.z, -q.w);
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
    let quat = vec4<f32>(quats[4u * i], quats[4u * i + 1u], quats[4u * i + 2u], quats[4u * i + 3u]);
    let pose = Pose(blended[5u * i], blended[5u * i + 1u], blended[5u * i + 2u], blended[5u * i + 3u]);
    let sums = blended[5u * i + 4u];
    let by_position = vec3<f32>(upstream[7u * i], upstream[7u * i + 1u], upstream[7u * i + 2u]);
    let by_turned =
        vec4<f32>(upstream[7u * i + 3u], upstream[7u * i + 4u], upstream[7u * i + 5u], upstream[7u * i + 6u]);

    let of_mean = by_position.x * pose.row_x + by_position.y * pose.row_y + by_position.z * pose.row_z;
    let of_quat = hamilton_product(conjugate(pose.turn), by_turned);
    for (var k = 0u; k < 3u; k++) {
        of_means[3u * i + k] = of_mean[k];
    }
    for (var k = 0u; k < 4u; k++) {
        of_quats[4u * i + k] = of_quat[k];
    }
    let by_turn = hamilton_product(by_turned, conjugate(quat));
    let still = Pose(
        vec4<f32>(1.0, 0.0, 0.0, 0.0),
        vec4<f32>(0.0, 1.0, 0.0, 0.0),
        vec4<f32>(0.0, 0.0, 1.0, 0.0),
        vec4<f32>(1.0, 0.0, 0.0, 0.0),
    );
    let inner = inner_product(pose, mean, by_position, by_turn);
    of_stillness[(1u + AFFINITIES) * i] = sums.z * (inner_product(still, mean, by_position, by_turn) - inner);
    handed[4u * i] = vec4<f32>(by_position, inner);
    handed[4u * i + 1u] = by_turn;
    handed[4u * i + 2u] = vec4<f32>(mean, sums.x);
    handed[4u * i + 3u] = vec4<f32>(sums.y, 0.0, 0.0, 0.0);
}
