// One Adam step, fused: one pass over parameter, gradient and both moments (Kingma and Ba, 2015).
//
// Each invocation computes one value. It reads the four old arrays and writes the three new ones.

struct Parameters {
    count: u32,
    beta_1: f32,
    // 1 - beta_1, computed in float64 and then rounded: in float32 the difference would lose digits.
    rest_1: f32,
    beta_2: f32,
    rest_2: f32,
    // Learning rate over the first moment's bias correction.
    step_size: f32,
    // Root of the second moment's bias correction.
    root_correction: f32,
    epsilon: f32,
}

@group(0) @binding(0) var<storage, read_write> parameter: array<f32>;
@group(0) @binding(1) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(2) var<storage, read_write> first_moment: array<f32>;
@group(0) @binding(3) var<storage, read_write> second_moment: array<f32>;
@group(0) @binding(4) var<storage, read_write> new_parameter: array<f32>;
@group(0) @binding(5) var<storage, read_write> new_first_moment: array<f32>;
@group(0) @binding(6) var<storage, read_write> new_second_moment: array<f32>;
@group(0) @binding(7) var<uniform> step: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= step.count) {
        return;
    }
    let g = gradient[i];
    let first = step.beta_1 * first_moment[i] + step.rest_1 * g;
    let second = step.beta_2 * second_moment[i] + step.rest_2 * g * g;
    new_first_moment[i] = first;
    new_second_moment[i] = second;
    new_parameter[i] = parameter[i] - step.step_size * first / (sqrt(second) / step.root_correction + step.epsilon);
}
