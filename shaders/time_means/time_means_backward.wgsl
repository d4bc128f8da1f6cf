// Gradients of two planes over time from those of their means, `upstream [2 M, B, A]`.
//
// Each invocation computes a column of one plane: all times of a channel and a place have the same gradient. First come the columns of
// `of_a [M, T, A]`, then those of `of_b [M, T, B]`.

// #include time_means

@group(0) @binding(0) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(1) var<storage, read_write> of_a: array<f32>;
@group(0) @binding(2) var<storage, read_write> of_b: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let a = parameters.a_length;
    let b = parameters.b_length;
    let columns_of_a = parameters.channels * a;
    var sum = 0.0;
    if (i < columns_of_a) {
        let channel = i / a;
        let place = i % a;
        for (var row = 0u; row < b; row++) {
            sum += upstream[(channel * b + row) * a + place];
        }
        for (var time = 0u; time < parameters.a_times; time++) {
            of_a[(channel * parameters.a_times + time) * a + place] = sum * parameters.a_share;
        }
        return;
    }
    let column = i - columns_of_a;
    let channel = column / b;
    if (channel >= parameters.channels) {
        return;
    }
    let place = column % b;
    for (var k = 0u; k < a; k++) {
        sum += upstream[((parameters.channels + channel) * b + place) * a + k];
    }
    for (var time = 0u; time < parameters.b_times; time++) {
        of_b[(channel * parameters.b_times + time) * b + place] = sum * parameters.b_share;
    }
}
