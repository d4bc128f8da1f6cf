// Sums of noise times gradient, by block: the noise is the difference of the noisy and the exact values of a tensor.
//
// A workgroup adds up BLOCK numbers of one tensor. A tensor has the same place in all three arrays.

// #include workgroup_sum, tensors

struct Tensors {
    count: u32,
    // Blocks of all tensors, and those of earlier launches.
    blocks: u32,
    blocks_before: u32,
    // Of each tensor: its first block, where it begins, its length.
    places: array<vec4<u32>, MOST_TENSORS>,
}

@group(0) @binding(0) var<storage, read_write> noisy: array<f32>;
@group(0) @binding(1) var<storage, read_write> exact: array<f32>;
@group(0) @binding(2) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
@group(0) @binding(4) var<uniform> tensors: Tensors;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    if (block >= tensors.blocks) {
        return;
    }
    let place = tensors.places[tensor_at(block)];
    let first = (block - place.x) * BLOCK;
    let end = min(first + BLOCK, place.z);
    var sum = 0.0;
    for (var i = first + lane; i < end; i += WORKGROUP) {
        let own = place.y + i;
        sum += (noisy[own] - exact[own]) * gradients[own];
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u) {
        sums[tensors.blocks_before + block] = total;
    }
}
