// One of the parts of skinning's derivative: the gradients of the Gaussians' affinities.
//
// One invocation owns one Gaussian and meets all nodes. Reads what it has handed over (see `skinning_backward.wgsl`), its
// affinities and the nodes. Writes all columns but the first of `of_stillness` [N, 1 + AFFINITIES].

struct Parameters {
    count: u32,
    nodes: u32,
}

@group(0) @binding(0) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(2) var<storage, read_write> precisions: array<f32>;
@group(0) @binding(3) var<storage, read_write> poses: array<f32>;
@group(0) @binding(4) var<storage, read_write> stillness: array<f32>;
@group(0) @binding(5) var<storage, read_write> of_stillness: array<f32>;
@group(0) @binding(6) var<uniform> parameters: Parameters;

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
    let by_position = handed[5u * i];
    let mean = handed[5u * i + 2u];
    let by_vector = handed[5u * i + 3u];
    let own = Turning(mean.xyz, handed[5u * i + 4u].xyz, by_position.xyz, by_vector.xyz, handed[5u * i + 1u]);
    var sums = vec4<f32>(0.0);
    for (var node = 0u; node < parameters.nodes; node++) {
        let place = (3u + AFFINITIES) * node;
        let offset = mean.xyz - vec3<f32>(anchors[place], anchors[place + 1u], anchors[place + 2u]);
        let exponent = affinity_between(i, node) - precisions[node] * dot(offset, offset);
        let weight = exponential(exponent - mean.w) * by_vector.w;
        let at = 16u * node;
        let pose = Pose(
            vec4<f32>(poses[at], poses[at + 1u], poses[at + 2u], poses[at + 9u]),
            vec4<f32>(poses[at + 3u], poses[at + 4u], poses[at + 5u], poses[at + 10u]),
            vec4<f32>(poses[at + 6u], poses[at + 7u], poses[at + 8u], poses[at + 11u]),
            vec4<f32>(poses[at + 12u], poses[at + 13u], poses[at + 14u], poses[at + 15u]),
        );
        let by_logit = weight * (inner_product(pose, own) - by_position.w);
        for (var k = 0u; k < AFFINITIES; k++) {
            sums[k] += by_logit * anchors[place + 3u + k];
        }
    }
    for (var k = 0u; k < AFFINITIES; k++) {
        of_stillness[(1u + AFFINITIES) * i + 1u + k] = sums[k];
    }
}
