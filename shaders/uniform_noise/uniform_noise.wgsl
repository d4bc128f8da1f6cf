// Values of several tensors with uniform noise, the same as `light4gs-model/src/ops/uniform_noise/cpu.rs` computes.
//
// Each invocation computes one value. A tensor has the same place in both arrays of values.

// #include tensors

struct Tensors {
    count: u32,
    // Values of all tensors, with the gaps between them.
    total: u32,
    // Of each tensor: where it begins, its length, its width, and 1 if that is to be multiplied by the unit.
    places: array<vec4<u32>, MOST_TENSORS>,
    // The two words of the seed of each tensor.
    seeds: array<vec4<u32>, MOST_TENSORS>,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> widths: array<f32>;
@group(0) @binding(2) var<storage, read_write> unit: array<f32>;
@group(0) @binding(3) var<storage, read_write> noisy: array<f32>;
@group(0) @binding(4) var<uniform> tensors: Tensors;

fn mixed(bits: u32) -> u32 {
    var x = bits;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= tensors.total) {
        return;
    }
    let tensor = tensor_at(own);
    let place = tensors.places[tensor];
    let i = own - place.x;
    if (i >= place.y) {
        return;
    }
    let width = widths[place.z] * select(1.0, unit[0], place.w == 1u);
    let seed = tensors.seeds[tensor];
    let bits = mixed(mixed(i + seed.x) ^ seed.y);
    let noise = f32(bits >> 8u) * (1.0 / 16777216.0) - 0.5;
    noisy[own] = values[own] + width * noise;
}
