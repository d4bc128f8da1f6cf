// Gradient through max(x, bound) that also passes below the bound where a descent step would increase x (Ballé et al.
// 2018). The maximum itself is Burn's own operation.
//
// Each invocation computes one value. It reads `values`, the x, and `upstream`, and writes `gradients`.

struct Parameters {
    count: u32,
    bound: f32,
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
    let gradient = upstream[i];
    let stopped = values[i] < parameters.bound && gradient >= 0.0;
    gradients[i] = select(gradient, 0.0, stopped);
}
