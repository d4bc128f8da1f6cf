// The position among sorted keys at which each group begins.
//
// Each invocation computes the beginning of one group, and a further one the end. It finds by bisection the first key
// that is not below its group's number, and writes the position to `starts`.

struct Parameters {
    // Keys, groups.
    count: u32,
    groups: u32,
}

@group(0) @binding(0) var<storage, read_write> keys: array<u32>;
@group(0) @binding(1) var<storage, read_write> starts: array<u32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own > parameters.groups) {
        return;
    }
    var low = 0u;
    var high = parameters.count;
    while (low < high) {
        let middle = low + (high - low) / 2u;
        if (keys[middle] < own) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    starts[own] = low;
}
