// One of the parts of skinning's derivative: what a slice of the Gaussians adds to the gradients of the nodes.
//
// One invocation owns one node and one slice, and adds up the Gaussians of the slice in their order; neighbors have the same slice, so
// that they read the same Gaussian at the same time. Reads what Gaussians hand over (see `skinning_backward.wgsl`) and the nodes.
// Writes `sums`, SUMS a node and slice: anchor (3), precision (1), pose (16), and affinities where there are any.

struct Parameters {
    count: u32,
    nodes: u32,
    // Gaussians of a slice.
    slice: u32,
}

@group(0) @binding(0) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> nodes: array<f32>;
@group(0) @binding(2) var<storage, read_write> affinities: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<vec4<f32>>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    let slice = own / parameters.nodes;
    let begin = slice * parameters.slice;
    if (begin >= parameters.count) {
        return;
    }
    let end = min(begin + parameters.slice, parameters.count);
    let node = own % parameters.nodes;
    let anchor = anchor_of(node);
    let sharpness = precision_of(node);
    let pose = pose_of(node);

    // Of the logit's gradient times the offset from the anchor, and times the squared distance.
    var of_place = vec4<f32>(0.0);
    var of_row_x = vec4<f32>(0.0);
    var of_row_y = vec4<f32>(0.0);
    var of_row_z = vec4<f32>(0.0);
    var of_turn = vec4<f32>(0.0);
    var of_affinities = vec4<f32>(0.0);
    for (var i = begin; i < end; i++) {
        let by_position = handed[4u * i];
        let mean = handed[4u * i + 2u];
        let inverse_sum = handed[4u * i + 3u].x;
        let other = Turning(mean.xyz, by_position.xyz, handed[4u * i + 1u]);
        let offset = mean.xyz - anchor;
        let squared = squared_length(offset);
        let exponent = exponent_between(i, node, squared);
        let weight = exponential(exponent - mean.w) * inverse_sum;
        let point = vec4<f32>(mean.xyz, 1.0);
        let by_logit = weight * (inner_product(pose, other) - by_position.w);
        of_place += by_logit * vec4<f32>(offset, squared);
        of_row_x += weight * (by_position.x * point);
        of_row_y += weight * (by_position.y * point);
        of_row_z += weight * (by_position.z * point);
        of_turn += weight * other.by_turn;
        for (var k = 0u; k < AFFINITIES; k++) {
            of_affinities[k] += by_logit * affinities[AFFINITIES * i + k];
        }
    }
    let at_sums = SUMS / 4u * own;
    sums[at_sums] = of_place * vec4<f32>(vec3<f32>(2.0 * sharpness), -1.0);
    sums[at_sums + 1u] = vec4<f32>(of_row_x.xyz, of_row_y.x);
    sums[at_sums + 2u] = vec4<f32>(of_row_y.yz, of_row_z.xy);
    sums[at_sums + 3u] = vec4<f32>(of_row_z.z, of_row_x.w, of_row_y.w, of_row_z.w);
    sums[at_sums + 4u] = of_turn;
    if (AFFINITIES > 0u) {
        sums[at_sums + 5u] = of_affinities;
    }
}
