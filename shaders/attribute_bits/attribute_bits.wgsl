// Bits of the positions, then of each channel, weighted; behind them the residuals [C, M].
//
// A workgroup owns a channel. Each of its invocations takes every WORKGROUP-th Gaussian. One more workgroup has the positions.

// #include exponential, mixture, attributes, attribute_bits, workgroup_sum

@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
@group(0) @binding(1) var<storage, read_write> prediction: array<f32>;
@group(0) @binding(2) var<storage, read_write> log_steps: array<f32>;
@group(0) @binding(3) var<storage, read_write> factors: array<f32>;
@group(0) @binding(4) var<storage, read_write> weight_logits: array<f32>;
@group(0) @binding(5) var<storage, read_write> means: array<f32>;
@group(0) @binding(6) var<storage, read_write> log_scales: array<f32>;
@group(0) @binding(7) var<storage, read_write> results: array<f32>;
@group(0) @binding(8) var<uniform> parameters: Parameters;

fn residual(channel: u32, m: u32) -> f32 {
    let channels = parameters.channels;
    let count = parameters.count;
    let weights = channel * 3u * channels;
    var predicted = prediction[weights + 2u * channels + channel] * numbers[(2u * channels + channel) * count + m];
    for (var column = attribute_of(channel).x; column <= channel; column++) {
        if (column < channel) {
            predicted += prediction[weights + column] * numbers[column * count + m];
        }
        predicted += prediction[weights + channels + column] * numbers[(channels + column) * count + m];
    }
    return numbers[channel * count + m] - predicted;
}

fn bits_of_positions() -> f32 {
    var logarithms = 0.0;
    if (parameters.extent.w > 0.0) {
        let cells = parameters.extent.xyz / exp(log_steps[parameters.position_step]) + 1.0;
        logarithms = log(cells.x) + log(cells.y) + log(cells.z);
    }
    return parameters.by_volume * parameters.extent.w * logarithms + parameters.position_bits;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let channel = flat_group(group, groups);
    if (channel > parameters.channels) {
        return;
    }
    if (channel == parameters.channels) {
        if (lane == 0u) {
            results[0] = parameters.position_weight * bits_of_positions();
        }
        return;
    }
    let place = attribute_of(channel).z;
    var mixture = mixture_of(channel, exp(log_steps[place]));
    var sum = 0.0;
    for (var m = lane; m < parameters.count; m += WORKGROUP) {
        let value = residual(channel, m);
        results[parameters.residuals + channel * parameters.count + m] = value;
        var likelihood = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            likelihood += mixture[k].weight * mass_around(value, mixture[k]).mass;
        }
        sum -= log2(max(likelihood, parameters.bound));
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u) {
        results[1u + channel] = parameters.channel_weight * factors[place] * total;
    }
}
