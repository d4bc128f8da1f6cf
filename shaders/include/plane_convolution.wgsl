// Sizes of a convolution from a larger plane to a smaller one, and its taps.

struct Parameters {
    large_channels: u32,
    large_height: u32,
    large_width: u32,
    // Bit 0: only taps with row + column odd. Bit 1: forward. Bit 2: transposed. Bit 3: 0 where row + column of the smaller plane is odd.
    flags: u32,
    small_channels: u32,
    small_height: u32,
    small_width: u32,
    // Of the leaky ReLU, below zero.
    slope: f32,
    kernel: u32,
    // Rows and columns of the larger plane between those of the smaller one.
    stride: u32,
    groups: u32,
    unused: u32,
}

fn uses_tap(parameters: Parameters, row: u32, column: u32) -> bool {
    return (parameters.flags & 1u) == 0u || ((row + column) & 1u) == 1u;
}

fn has_output(parameters: Parameters, row: u32, column: u32) -> bool {
    return (parameters.flags & 8u) == 0u || ((row + column) & 1u) == 0u;
}

fn inputs_of_group(parameters: Parameters) -> u32 {
    return parameters.large_channels / parameters.groups;
}

fn outputs_of_group(parameters: Parameters) -> u32 {
    return parameters.small_channels / parameters.groups;
}

fn is_forward(parameters: Parameters) -> bool {
    return (parameters.flags & 2u) != 0u;
}

// A value, or its gradient, through the leaky ReLU; `output` has the sign of what goes into it.
fn leaky(value: f32, output: f32, slope: f32) -> f32 {
    return select(slope * value, value, output > 0.0);
}
