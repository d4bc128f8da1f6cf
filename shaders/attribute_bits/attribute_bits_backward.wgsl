// Derivative of the bits of a channel: by its residuals, its mixture of logistics, the logarithm of its step.
//
// A workgroup owns a channel. Each of its invocations takes every WORKGROUP-th residual, writes its gradient, and sums the gradients of
// the mixture; then each sum is added up over the invocations, in order. A channel has SUMS = 1 + 3 COMPONENTS of them: the width of the
// intervals, the logits of the weights, the means, the logarithms of the scales.

// #include exponential, mixture, attributes, attribute_bits

const SUMS: u32 = 1u + 3u * COMPONENTS;

@group(0) @binding(0) var<storage, read_write> residuals: array<f32>;
@group(0) @binding(1) var<storage, read_write> log_steps: array<f32>;
@group(0) @binding(2) var<storage, read_write> factors: array<f32>;
@group(0) @binding(3) var<storage, read_write> weight_logits: array<f32>;
@group(0) @binding(4) var<storage, read_write> means: array<f32>;
@group(0) @binding(5) var<storage, read_write> log_scales: array<f32>;
@group(0) @binding(6) var<storage, read_write> upstream: array<f32>;
// Gradients of the residuals, then of the rest.
@group(0) @binding(7) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(8) var<uniform> parameters: Parameters;

var<workgroup> partial: array<array<f32, SUMS>, WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let channel = flat_group(group, groups);
    if (channel >= parameters.channels) {
        return;
    }
    let place = attribute_of(channel).z;
    let width = exp(log_steps[place]);
    var mixture = mixture_of(channel, width);
    let slope = -1.44269504 * upstream[1u + channel] * parameters.channel_weight * factors[place];
    var sums: array<f32, SUMS>;
    for (var m = lane; m < parameters.count; m += WORKGROUP) {
        let i = channel * parameters.count + m;
        let value = residuals[i];
        var masses: array<Mass, COMPONENTS>;
        var likelihood = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            masses[k] = mass_around(value, mixture[k]);
            likelihood += mixture[k].weight * masses[k].mass;
        }
        // Below the bound only a step that raises the likelihood counts.
        let counts = likelihood >= parameters.bound || slope < 0.0;
        let by_likelihood = select(0.0, slope / max(likelihood, parameters.bound), counts);
        var of_residual = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            let weighted = by_likelihood * mixture[k].weight;
            let by_distance = weighted * masses[k].by_distance;
            let by_half_width = weighted * masses[k].by_half_width;
            of_residual += by_distance * mixture[k].inverse_scale;
            sums[0] += 0.5 * by_half_width * mixture[k].inverse_scale;
            sums[1u + k] += weighted * (masses[k].mass - likelihood);
            sums[1u + COMPONENTS + k] -= by_distance * mixture[k].inverse_scale;
            sums[1u + 2u * COMPONENTS + k] -=
                by_distance * masses[k].distance + by_half_width * mixture[k].half_width;
        }
        gradients[i] = of_residual;
    }
    partial[lane] = sums;
    workgroupBarrier();
    for (var own = lane; own < SUMS; own += WORKGROUP) {
        var total = 0.0;
        for (var k = 0u; k < WORKGROUP; k++) {
            total += partial[k][own];
        }
        if (own == 0u) {
            gradients[parameters.of_steps + channel] = total * width;
        } else {
            let k = own - 1u;
            let start = parameters.mixture_starts[k / COMPONENTS];
            gradients[start + channel * COMPONENTS + k % COMPONENTS] = total;
        }
    }
}
