// The logistic function, 1 / (1 + exp(-x)).
//
// Each invocation computes one value. It reads `places` and writes `values`.

// #include exponential, activation

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> places: array<f32>;
@group(0) @binding(1) var<storage, read_write> values: array<f32>;
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
    values[i] = sigmoid(places[i]);
}
