// What the kernels of the attributes' bits share. Each of them has the same uniform, `parameters`.
//
// The bits of a channel are those of its residuals: its numbers less a linear prediction. `numbers` [3 C, M] has a column for each of M
// Gaussians: its own channels, their means over its neighbors, the channels of the nearest one. A channel is predicted from the
// channels of its attribute before it, and around it also from itself.

// #include attributes

struct Parameters {
    // C, M
    channels: u32,
    count: u32,
    // Attributes, those without densities too.
    steps: u32,
    // Likelihoods below this are raised to it.
    bound: f32,
    // What a bit of a channel counts, times the factor of its attribute; what a bit of the positions counts.
    channel_weight: f32,
    position_weight: f32,
    // Bits of the positions besides `position_scale` for each logarithm of an axis' cells, which count only if `by_volume` is 1.
    position_bits: f32,
    by_volume: f32,
    // Of the box of the positions, in units of the Gaussians' size; and `position_scale`, 0 without positions.
    extent: vec4<f32>,
    // The place of the positions' step; where the residuals begin behind the bits; where the gradients of the steps begin in those of
    // the residuals.
    position_step: u32,
    residuals: u32,
    of_steps: u32,
    unused: u32,
    // Where the gradients begin: of the logits, means and logarithms of scales of the mixtures; of prediction and steps.
    mixture_starts: vec4<u32>,
    starts: vec4<u32>,
    attributes: Attributes,
}

// Whether a channel is predicted from a row of `numbers`.
fn predicts(input: u32, channel: u32) -> bool {
    let column = input % parameters.channels;
    let part = input / parameters.channels;
    if (part == 2u) {
        return column == channel;
    }
    return attribute_of(channel).x <= column && column < channel + part;
}
