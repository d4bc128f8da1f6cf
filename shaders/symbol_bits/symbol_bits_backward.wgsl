// Derivative of the bits of a symbol by its probability, times the upstream gradient. Below the bound it is zero, or passes where a
// descent step would increase the probability (Ballé et al. 2018).
//
// Each invocation computes one value. It reads `likelihoods` and `upstream`, and writes `gradients`.

struct Parameters {
    count: u32,
    bound: f32,
    // Not 0 if it is zero below the bound.
    stays: f32,
}

const LOG2_E: f32 = 1.4426950408889634;

@group(0) @binding(0) var<storage, read_write> likelihoods: array<f32>;
@group(0) @binding(1) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(2) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

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
    let gradient = -LOG2_E * upstream[i] / max(likelihoods[i], parameters.bound);
    let stopped = likelihoods[i] < parameters.bound && (parameters.stays != 0.0 || gradient >= 0.0);
    gradients[i] = select(gradient, 0.0, stopped);
}
