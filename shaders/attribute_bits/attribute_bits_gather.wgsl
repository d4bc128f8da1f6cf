// Derivative of the bits of all channels, from that by the residuals and by each channel's step: by the numbers, the weights of the
// prediction, the logarithms of the steps.
//
// The first 3 C² workgroups own a weight of the prediction each, the next one owns the steps, and of the others each invocation owns a
// number.

// #include attributes, attribute_bits

@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
@group(0) @binding(1) var<storage, read_write> prediction: array<f32>;
@group(0) @binding(2) var<storage, read_write> log_steps: array<f32>;
@group(0) @binding(3) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_channels: array<f32>;
// Gradients of the numbers, then of the rest.
@group(0) @binding(5) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(6) var<uniform> parameters: Parameters;

var<workgroup> partial: array<f32, WORKGROUP>;

fn of_number(input: u32, m: u32) -> f32 {
    let channels = parameters.channels;
    let count = parameters.count;
    let column = input % channels;
    let own = attribute_of(column);
    var sum = 0.0;
    if (input < channels) {
        sum = of_channels[column * count + m];
    }
    for (var channel = column; channel < own.x + own.y; channel++) {
        if (predicts(input, channel)) {
            sum -= prediction[channel * 3u * channels + input] * of_channels[channel * count + m];
        }
    }
    return sum;
}

fn of_step(place: u32) -> f32 {
    var sum = 0.0;
    for (var channel = 0u; channel < parameters.channels; channel++) {
        if (attribute_of(channel).z == place) {
            sum += of_channels[parameters.of_steps + channel];
        }
    }
    if (parameters.extent.w > 0.0 && place == parameters.position_step) {
        // The logarithm of `extent / step + 1`, by that of the step.
        let cells = parameters.extent.xyz / exp(log_steps[place]);
        let slopes = cells / (cells + 1.0);
        let scale = upstream[0] * parameters.position_weight * parameters.extent.w;
        sum -= scale * (slopes.x + slopes.y + slopes.z);
    }
    return sum;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let owner = flat_group(group, groups);
    let inputs = 3u * parameters.channels;
    let weights = inputs * parameters.channels;
    let count = parameters.count;
    if (owner < weights) {
        let channel = owner / inputs;
        let input = owner % inputs;
        let place = parameters.starts.x + owner;
        if (!predicts(input, channel)) {
            if (lane == 0u) {
                gradients[place] = 0.0;
            }
            return;
        }
        var sum = 0.0;
        for (var m = lane; m < count; m += WORKGROUP) {
            sum -= of_channels[channel * count + m] * numbers[input * count + m];
        }
        partial[lane] = sum;
        workgroupBarrier();
        if (lane == 0u) {
            var total = 0.0;
            for (var k = 0u; k < WORKGROUP; k++) {
                total += partial[k];
            }
            gradients[place] = total;
        }
    } else if (owner == weights) {
        for (var place = lane; place < parameters.steps; place += WORKGROUP) {
            gradients[parameters.starts.y + place] = of_step(place);
        }
    } else {
        let i = (owner - weights - 1u) * WORKGROUP + lane;
        if (i < inputs * count) {
            gradients[i] = of_number(i / count, i % count);
        }
    }
}
