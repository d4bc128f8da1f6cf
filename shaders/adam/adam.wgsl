// One Adam step of several tensors, fused: one pass over parameters, gradients and both moments (Kingma and Ba, 2015).
//
// Each invocation computes one number. It reads the four old arrays and writes the three new ones, in all of which a tensor has the
// same place.

// #include tensors

struct Tensors {
    count: u32,
    // Numbers of all tensors, with the gaps between them.
    total: u32,
    // Of each tensor: where it begins, its length, then as float32 the learning rate over the first moment's bias correction and the
    // root of the second moment's.
    places: array<vec4<u32>, MOST_TENSORS>,
    // beta_1, 1 - beta_1, beta_2, 1 - beta_2. The differences are computed in float64 and then rounded: in float32 they would lose
    // digits.
    decays: array<vec4<f32>, MOST_TENSORS>,
    // Epsilon.
    epsilons: array<vec4<f32>, MOST_TENSORS>,
}

@group(0) @binding(0) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(1) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(2) var<storage, read_write> first_moments: array<f32>;
@group(0) @binding(3) var<storage, read_write> second_moments: array<f32>;
@group(0) @binding(4) var<storage, read_write> new_parameters: array<f32>;
@group(0) @binding(5) var<storage, read_write> new_first_moments: array<f32>;
@group(0) @binding(6) var<storage, read_write> new_second_moments: array<f32>;
@group(0) @binding(7) var<uniform> tensors: Tensors;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= tensors.total) {
        return;
    }
    let tensor = tensor_at(i);
    let place = tensors.places[tensor];
    if (i - place.x >= place.y) {
        return;
    }
    let decay = tensors.decays[tensor];
    let g = gradients[i];
    let first = decay.x * first_moments[i] + decay.y * g;
    let second = decay.z * second_moments[i] + decay.w * g * g;
    let step_size = bitcast<f32>(place.z);
    let root_correction = bitcast<f32>(place.w);
    new_first_moments[i] = first;
    new_second_moments[i] = second;
    new_parameters[i] = parameters[i] - step_size * first / (sqrt(second) / root_correction + tensors.epsilons[tensor].x);
}
