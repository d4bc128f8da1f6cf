// Values with uniform noise, the same as `light4gs-model/src/ops/uniform_noise/cpu.rs` computes.
//
// Each invocation computes one value.

struct Parameters {
    count: u32,
    // The width of these values.
    which: u32,
    seed_a: u32,
    seed_b: u32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> widths: array<f32>;
@group(0) @binding(2) var<storage, read_write> noisy: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

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
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.count) {
        return;
    }
    let bits = mixed(mixed(i + parameters.seed_a) ^ parameters.seed_b);
    let noise = f32(bits >> 8u) * (1.0 / 16777216.0) - 0.5;
    noisy[i] = values[i] + widths[parameters.which] * noise;
}
