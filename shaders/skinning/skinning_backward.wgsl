// First of the parts of skinning's derivative: the gradients of the Gaussians, and what they hand to the nodes.
//
// One invocation owns one Gaussian. Reads it, its blended pose (see `skinning.wgsl`) and `upstream` [N, 7]. Writes to
// `gradients` those of mean, quaternion and stillness, and four vectors of `handed`:
//
//   0: upstream gradient of the position; the inner product of the blended pose with the derivatives by it
//   1: derivative by the blended quaternion
//   2: mean; the largest exponent
//   3: the inverse of the sum of the weights

struct Parameters {
    count: u32,
    // Where gradients begin; those of means are first.
    quats: u32,
    stillness: u32,
}

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> blended: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(4) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(6) var<uniform> parameters: Parameters;

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
    let at = 7u * i;
    let by_position = vec3<f32>(upstream[at], upstream[at + 1u], upstream[at + 2u]);
    let by_turned = vec4<f32>(upstream[at + 3u], upstream[at + 4u], upstream[at + 5u], upstream[at + 6u]);

    let of_mean = by_position.x * pose.row_x + by_position.y * pose.row_y + by_position.z * pose.row_z;
    let of_quat = hamilton_product(conjugate(pose.turn), by_turned);
    for (var k = 0u; k < 3u; k++) {
        gradients[3u * i + k] = of_mean[k];
    }
    for (var k = 0u; k < 4u; k++) {
        gradients[parameters.quats + 4u * i + k] = of_quat[k];
    }
    let by_turn = hamilton_product(by_turned, conjugate(quat));
    let still = Pose(
        vec4<f32>(1.0, 0.0, 0.0, 0.0),
        vec4<f32>(0.0, 1.0, 0.0, 0.0),
        vec4<f32>(0.0, 0.0, 1.0, 0.0),
        vec4<f32>(1.0, 0.0, 0.0, 0.0),
    );
    let turning = Turning(mean, by_position, by_turn);
    let inner = inner_product(pose, turning);
    gradients[parameters.stillness + i] = sums.z * (inner_product(still, turning) - inner);
    handed[4u * i] = vec4<f32>(by_position, inner);
    handed[4u * i + 1u] = by_turn;
    handed[4u * i + 2u] = vec4<f32>(mean, sums.x);
    handed[4u * i + 3u] = vec4<f32>(sums.y, 0.0, 0.0, 0.0);
}
