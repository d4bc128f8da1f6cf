// Sums of blocks that follow each other.
//
// A workgroup adds up the blocks of one sum.

// #include workgroup_sum

struct Sums {
    count: u32,
    // Sums of earlier launches.
    before: u32,
    // Of each sum: its first block, and the one behind its last.
    ranges: array<vec4<u32>, MOST_SUMS>,
}

@group(0) @binding(0) var<storage, read_write> blocks: array<f32>;
@group(0) @binding(1) var<storage, read_write> sums: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Sums;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups);
    if (own >= parameters.count) {
        return;
    }
    let range = parameters.ranges[own];
    var sum = 0.0;
    for (var block = range.x + lane; block < range.y; block += WORKGROUP) {
        sum += blocks[block];
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u) {
        sums[parameters.before + own] = total;
    }
}
