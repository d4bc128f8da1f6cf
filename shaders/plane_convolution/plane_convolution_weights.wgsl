// Gradients of the weights and of the bias of a convolution from its input and the gradient of its output. `large [I, H, W]` and
// `small [O, h, w]` are these two, in this order, or of a transposed convolution in the other one; `outputs` is its output.
//
// A workgroup owns the kernel between an input and an output channel. For each tap its invocations take every WORKGROUP-th place of the
// smaller plane, and their sums are added up. The workgroups after the last kernel own a channel of the bias each.

// #include workgroup_sum, plane_convolution

@group(0) @binding(0) var<storage, read_write> large: array<f32>;
@group(0) @binding(1) var<storage, read_write> small: array<f32>;
@group(0) @binding(2) var<storage, read_write> outputs: array<f32>;
@group(0) @binding(3) var<storage, read_write> of_weight: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_bias: array<f32>;
@group(0) @binding(5) var<uniform> parameters: Parameters;

fn is_transposed() -> bool {
    return (parameters.flags & 4u) != 0u;
}

// Values of the planes, the gradient among them through the leaky ReLU.
fn large_value(i: u32) -> f32 {
    if (is_transposed()) {
        return leaky(large[i], outputs[i], parameters.slope);
    }
    return large[i];
}

fn small_value(channel: u32, place: u32) -> f32 {
    let width = parameters.small_width;
    let i = channel * parameters.small_height * width + place;
    if (is_transposed()) {
        return small[i];
    }
    if (!has_output(parameters, place / width, place % width)) {
        return 0.0;
    }
    return leaky(small[i], outputs[i], parameters.slope);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups);
    let inputs = inputs_of_group(parameters);
    let kernels = parameters.small_channels * inputs;
    let small_area = parameters.small_height * parameters.small_width;
    let large_area = parameters.large_height * parameters.large_width;
    if (own >= kernels) {
        let channel = own - kernels;
        if (channel >= select(parameters.small_channels, parameters.large_channels, is_transposed())) {
            return;
        }
        var sum = 0.0;
        if (is_transposed()) {
            for (var i = lane; i < large_area; i += WORKGROUP) {
                sum += large_value(channel * large_area + i);
            }
        } else {
            for (var i = lane; i < small_area; i += WORKGROUP) {
                sum += small_value(channel, i);
            }
        }
        let total = workgroup_sum(sum, lane);
        if (lane == 0u) {
            of_bias[channel] = total;
        }
        return;
    }
    let output = own / inputs;
    let input = output / outputs_of_group(parameters) * inputs + own % inputs;
    let kernel = parameters.kernel;
    let before = kernel / 2u;
    for (var tap = 0u; tap < kernel * kernel; tap++) {
        let down = tap / kernel;
        let right = tap % kernel;
        var sum = 0.0;
        if (uses_tap(parameters, down, right)) {
            for (var i = lane; i < small_area; i += WORKGROUP) {
                // Below 0 these wrap around to numbers beyond the last row or column.
                let row = i / parameters.small_width * parameters.stride + down - before;
                let column = i % parameters.small_width * parameters.stride + right - before;
                if (row < parameters.large_height && column < parameters.large_width) {
                    let met = input * large_area + row * parameters.large_width + column;
                    sum += small_value(output, i) * large_value(met);
                }
            }
        }
        let total = workgroup_sum(sum, lane);
        if (lane == 0u) {
            of_weight[own * kernel * kernel + tap] = total;
        }
        // The sums are read before the next ones are written.
        workgroupBarrier();
    }
}
