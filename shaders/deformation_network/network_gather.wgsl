// Last of the parts of a deformation network's derivative: adds up the parts of the rows, in their order.
//
// One invocation owns one parameter. Reads the sums of `network_weights.wgsl`. Writes the gradients of all parameters.

struct Parts {
    parts: u32,
    // Numbers of all parameters.
    parameters: u32,
}

@group(0) @binding(0) var<storage, read_write> sums: array<f32>;
@group(0) @binding(1) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(2) var<uniform> counts: Parts;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= counts.parameters) {
        return;
    }
    var sum = 0.0;
    for (var part = 0u; part < counts.parts; part++) {
        sum += sums[part * counts.parameters + own];
    }
    gradients[own] = sum;
}
