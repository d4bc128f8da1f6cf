// The bits of a symbol of each probability, which is raised to a bound.
//
// Each invocation computes one value. It reads `likelihoods` and writes `bits`.

struct Parameters {
    count: u32,
    bound: f32,
}

@group(0) @binding(0) var<storage, read_write> likelihoods: array<f32>;
@group(0) @binding(1) var<storage, read_write> bits: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

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
    bits[i] = -log2(max(likelihoods[i], parameters.bound));
}
