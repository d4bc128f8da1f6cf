// Means of two planes over time, spread over the plane of their space axes.
//
// Each invocation computes one value of `means [2 M, B, A]`: in the first M channels the mean of a column of `over_a [M, T, A]`, in the
// others that of a column of `over_b [M, T, B]`.

// #include time_means

@group(0) @binding(0) var<storage, read_write> over_a: array<f32>;
@group(0) @binding(1) var<storage, read_write> over_b: array<f32>;
@group(0) @binding(2) var<storage, read_write> means: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let area = parameters.a_length * parameters.b_length;
    let channel = i / area;
    if (channel >= 2u * parameters.channels) {
        return;
    }
    var sum = 0.0;
    if (channel < parameters.channels) {
        let column = channel * parameters.a_times * parameters.a_length + i % parameters.a_length;
        for (var time = 0u; time < parameters.a_times; time++) {
            sum += over_a[column + time * parameters.a_length];
        }
        sum *= parameters.a_share;
    } else {
        let row = i % area / parameters.a_length;
        let column = (channel - parameters.channels) * parameters.b_times * parameters.b_length + row;
        for (var time = 0u; time < parameters.b_times; time++) {
            sum += over_b[column + time * parameters.b_length];
        }
        sum *= parameters.b_share;
    }
    means[i] = sum;
}
