// Last of the parts of skinning's derivative: adds up the slices, in their order.
//
// One invocation owns one of the SUMS numbers of a node: twenty, and four more where there are affinities. Reads the sums of
// `skinning_nodes.wgsl`. Writes the gradients of the nodes [B, 20 + AFFINITIES].

struct Parameters {
    nodes: u32,
    slices: u32,
}

@group(0) @binding(0) var<storage, read_write> sums: array<f32>;
@group(0) @binding(1) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    let stride = SUMS * parameters.nodes;
    if (own >= stride) {
        return;
    }
    var sum = 0.0;
    for (var slice = 0u; slice < parameters.slices; slice++) {
        sum += sums[slice * stride + own];
    }
    let k = own % SUMS;
    if (k < 20u + AFFINITIES) {
        gradients[(20u + AFFINITIES) * (own / SUMS) + k] = sum;
    }
}
