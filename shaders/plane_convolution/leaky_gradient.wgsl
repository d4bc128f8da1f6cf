// The gradient through a leaky ReLU, from its output, which has the sign of its input.
//
// Each invocation computes one value. It reads `outputs` and `upstream`, and writes `gradients`.

struct Parameters {
    count: u32,
    slope: f32,
}

@group(0) @binding(0) var<storage, read_write> outputs: array<f32>;
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
    gradients[i] = select(parameters.slope * upstream[i], upstream[i], outputs[i] > 0.0);
}
