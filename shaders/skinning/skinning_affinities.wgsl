// One of the parts of skinning's derivative: the gradients of the Gaussians' affinities.
//
// One invocation owns one Gaussian and meets all nodes. Reads what it has handed over (see `skinning_backward.wgsl`), its
// affinities and the nodes. Writes `of_affinities` [N, AFFINITIES].

struct Parameters {
    count: u32,
    nodes: u32,
}

@group(0) @binding(0) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> nodes: array<f32>;
@group(0) @binding(2) var<storage, read_write> affinities: array<f32>;
@group(0) @binding(3) var<storage, read_write> of_affinities: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

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
    let by_position = handed[4u * i];
    let mean = handed[4u * i + 2u];
    let inverse_sum = handed[4u * i + 3u].x;
    let own = Turning(mean.xyz, by_position.xyz, handed[4u * i + 1u]);
    var sums = vec4<f32>(0.0);
    for (var node = 0u; node < parameters.nodes; node++) {
        let exponent = exponent_between(i, node, squared_length(mean.xyz - anchor_of(node)));
        let weight = exponential(exponent - mean.w) * inverse_sum;
        let by_logit = weight * (inner_product(pose_of(node), own) - by_position.w);
        for (var k = 0u; k < AFFINITIES; k++) {
            sums[k] += by_logit * affinity_of(node, k);
        }
    }
    for (var k = 0u; k < AFFINITIES; k++) {
        of_affinities[AFFINITIES * i + k] = sums[k];
    }
}
