// Derivative of the bounded exponential: the upstream gradient times the value, and 0 where the bound was reached.
//
// Each invocation computes one value. It reads the function's `values` and `upstream`, and writes `gradients`.

struct Parameters {
    count: u32,
    // Values from here on have reached the bound.
    reached: f32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
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
    let value = values[i];
    gradients[i] = select(upstream[i] * value, 0.0, value >= parameters.reached);
}
