// The smaller plane of a convolution from the larger one, plus the bias, through the leaky ReLU. It is also the gradient of the
// transposed convolution by its input, through the leaky ReLU behind that one.
//
// Each invocation computes one value of the smaller plane `small [O, h, w]`. It reads `large [I, H, W]`,
// `weight [O, I / groups, kernel, kernel]` and `beside`: forward the bias `[O]`,
// backward the output of which `large` is the gradient.

// #include plane_convolution

@group(0) @binding(0) var<storage, read_write> large: array<f32>;
@group(0) @binding(1) var<storage, read_write> weight: array<f32>;
@group(0) @binding(2) var<storage, read_write> beside: array<f32>;
@group(0) @binding(3) var<storage, read_write> small: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

fn source_value(i: u32) -> f32 {
    if (is_forward(parameters)) {
        return large[i];
    }
    return leaky(large[i], beside[i], parameters.slope);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let area = parameters.small_height * parameters.small_width;
    if (i >= parameters.small_channels * area) {
        return;
    }
    let channel = i / area;
    let row = i % area / parameters.small_width;
    let column = i % parameters.small_width;
    if (!has_output(parameters, row, column)) {
        small[i] = 0.0;
        return;
    }
    let kernel = parameters.kernel;
    let before = kernel / 2u;
    let inputs = inputs_of_group(parameters);
    let first = channel / outputs_of_group(parameters) * inputs;
    var sum = 0.0;
    for (var input = 0u; input < inputs; input++) {
        let plane = (first + input) * parameters.large_height;
        let kernel_at = (channel * inputs + input) * kernel * kernel;
        for (var down = 0u; down < kernel; down++) {
            // Below 0 it wraps around to a number beyond the last row.
            let source_row = row * parameters.stride + down - before;
            if (source_row >= parameters.large_height) {
                continue;
            }
            let source = (plane + source_row) * parameters.large_width;
            for (var right = 0u; right < kernel; right++) {
                let source_column = column * parameters.stride + right - before;
                if (source_column < parameters.large_width && uses_tap(parameters, down, right)) {
                    sum += weight[kernel_at + down * kernel + right] * source_value(source + source_column);
                }
            }
        }
    }
    if (is_forward(parameters)) {
        sum += beside[channel];
        sum = leaky(sum, sum, parameters.slope);
    }
    small[i] = sum;
}
