// The larger plane of a transposed convolution from the smaller one, plus the bias, through the leaky ReLU. It is also the gradient of
// the convolution by its input, through the leaky ReLU behind that one.
//
// Each invocation computes one value of the larger plane `large [I, H, W]`. It reads `small [O, h, w]`,
// `weight [O, I / groups, kernel, kernel]` and `beside`: forward the bias `[I]`,
// backward the output of which `small` is the gradient.

// #include plane_convolution

@group(0) @binding(0) var<storage, read_write> small: array<f32>;
@group(0) @binding(1) var<storage, read_write> weight: array<f32>;
@group(0) @binding(2) var<storage, read_write> beside: array<f32>;
@group(0) @binding(3) var<storage, read_write> large: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

fn source_value(i: u32) -> f32 {
    if (is_forward(parameters)) {
        return small[i];
    }
    return leaky(small[i], beside[i], parameters.slope);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let area = parameters.large_height * parameters.large_width;
    if (i >= parameters.large_channels * area) {
        return;
    }
    let channel = i / area;
    let row = i % area / parameters.large_width;
    let column = i % parameters.large_width;
    let kernel = parameters.kernel;
    let before = kernel / 2u;
    let inputs = inputs_of_group(parameters);
    let outputs = outputs_of_group(parameters);
    let first = channel / inputs * outputs;
    var sum = 0.0;
    for (var output = 0u; output < outputs; output++) {
        let plane = (first + output) * parameters.small_height;
        let kernel_at = ((first + output) * inputs + channel % inputs) * kernel * kernel;
        for (var down = 0u; down < kernel; down++) {
            // The row of the smaller plane whose tap meets this one, in steps of the stride. Below 0 it wraps around to a number
            // beyond the last row.
            let strided_row = row + before - down;
            let source_row = strided_row / parameters.stride;
            if (strided_row % parameters.stride != 0u || source_row >= parameters.small_height) {
                continue;
            }
            let source = (plane + source_row) * parameters.small_width;
            for (var right = 0u; right < kernel; right++) {
                let strided_column = column + before - right;
                let source_column = strided_column / parameters.stride;
                let meets = strided_column % parameters.stride == 0u && source_column < parameters.small_width;
                let used = uses_tap(parameters, down, right) && has_output(parameters, source_row, source_column);
                if (meets && used) {
                    sum += weight[kernel_at + down * kernel + right] * source_value(source + source_column);
                }
            }
        }
    }
    if (is_forward(parameters)) {
        sum += beside[channel];
        sum = leaky(sum, sum, parameters.slope);
    }
    large[i] = sum;
}
