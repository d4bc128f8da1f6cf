// Derivative of the standard normal distribution function: its density times the upstream gradient.
//
// Each invocation computes one value. It reads `places` and `upstream`, and writes `gradients`.

// #include exponential

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> places: array<f32>;
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
    let x = places[i];
    // 1 / sqrt(2 pi)
    gradients[i] = upstream[i] * (0.39894228 * exponential(-0.5 * x * x));
}
