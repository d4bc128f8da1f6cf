// First of the parts of skinning's derivative: the gradients of the Gaussians, and the values that they hand to the
// nodes.
//
// One invocation owns one Gaussian, and meets all nodes if there are affinities. Reads it, its blended pose (see `skinning.wgsl`), the
// nodes, and `upstream`: the gradients of its moved position [N, 3] and quaternion [N, 4]. Writes to `results` first what it hands to the
// nodes, four vectors, then the gradients of mean, quaternion, stillness and affinities. The vectors are:
//
//   0: upstream gradient of the position; the inner product of the blended pose with the derivatives by it
//   1: derivative by the blended quaternion
//   2: mean; the largest exponent
//   3: the inverse of the sum of the weights

// #include exponential, quaternion, pose, node

struct Parameters {
    count: u32,
    nodes: u32,
    // Where the upstream gradients of quaternions begin.
    by_turned: u32,
    // Where gradients begin.
    means: u32,
    quats: u32,
    stillness: u32,
    affinities: u32,
}

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> blended: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(4) var<storage, read_write> nodes: array<f32>;
@group(0) @binding(5) var<storage, read_write> affinities: array<f32>;
@group(0) @binding(6) var<storage, read_write> results: array<f32>;
@group(0) @binding(7) var<uniform> parameters: Parameters;

fn hand(i: u32, k: u32, vector: vec4<f32>) {
    for (var part = 0u; part < 4u; part++) {
        results[16u * i + 4u * k + part] = vector[part];
    }
}

fn conjugate(q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(q.x, -q.y, -q.z, -q.w);
}

// `inner` is the inner product of the blended pose with the derivatives by it; `sums` are those of `blended`.
fn gradients_of_affinities(i: u32, own: Turning, inner: f32, sums: vec4<f32>) -> vec4<f32> {
    var gradients_of_own = vec4<f32>(0.0);
    for (var node = 0u; node < parameters.nodes; node++) {
        let exponent = exponent_between(i, node, squared_length(own.mean - anchor_of(node)));
        let weight = exponential(exponent - sums.x) * sums.y;
        let by_logit = weight * (inner_product(pose_of(node), own) - inner);
        for (var k = 0u; k < AFFINITIES; k++) {
            gradients_of_own[k] += by_logit * affinity_of(node, k);
        }
    }
    return gradients_of_own;
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
    let by_position = vec3<f32>(upstream[3u * i], upstream[3u * i + 1u], upstream[3u * i + 2u]);
    let at = parameters.by_turned + 4u * i;
    let by_turned = vec4<f32>(upstream[at], upstream[at + 1u], upstream[at + 2u], upstream[at + 3u]);

    let of_mean = by_position.x * pose.row_x + by_position.y * pose.row_y + by_position.z * pose.row_z;
    let of_quat = hamilton_product(conjugate(pose.turn), by_turned);
    for (var k = 0u; k < 3u; k++) {
        results[parameters.means + 3u * i + k] = of_mean[k];
    }
    for (var k = 0u; k < 4u; k++) {
        results[parameters.quats + 4u * i + k] = of_quat[k];
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
    results[parameters.stillness + i] = sums.z * (inner_product(still, turning) - inner);
    hand(i, 0u, vec4<f32>(by_position, inner));
    hand(i, 1u, by_turn);
    hand(i, 2u, vec4<f32>(mean, sums.x));
    hand(i, 3u, vec4<f32>(sums.y, 0.0, 0.0, 0.0));
    if (AFFINITIES > 0u) {
        let of_affinities = gradients_of_affinities(i, turning, inner, sums);
        for (var k = 0u; k < AFFINITIES; k++) {
            results[parameters.affinities + AFFINITIES * i + k] = of_affinities[k];
        }
    }
}
