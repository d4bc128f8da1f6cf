// Derivative of the bits of a channel under its mixture of logistics.
//
// A workgroup owns a channel. Each of its invocations takes every WORKGROUP-th value, writes its gradient, and sums the gradients of
// the mixture; then each sum is added up over the invocations, in order. A channel has SUMS = 1 + 3 COMPONENTS of them: the width, the
// logits of the weights, the means, the logarithms of the scales. In `of_mixture` stand the gradients of all widths, then all logits,
// and so on, each array from its place in `starts`.

// #include exponential, mixture

struct Parameters {
    channels: u32,
    // Values of a channel.
    count: u32,
    // Likelihoods below this are raised to it.
    bound: f32,
    unused: u32,
    starts: vec4<u32>,
}

const SUMS: u32 = 1u + 3u * COMPONENTS;

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> widths: array<f32>;
@group(0) @binding(2) var<storage, read_write> weight_logits: array<f32>;
@group(0) @binding(3) var<storage, read_write> means: array<f32>;
@group(0) @binding(4) var<storage, read_write> log_scales: array<f32>;
@group(0) @binding(5) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(6) var<storage, read_write> of_values: array<f32>;
@group(0) @binding(7) var<storage, read_write> of_mixture: array<f32>;
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
    var mixture = mixture_of(channel);
    let slope = -1.44269504 * upstream[channel];
    var sums: array<f32, SUMS>;
    for (var i = lane; i < parameters.count; i += WORKGROUP) {
        let value = values[channel * parameters.count + i];
        var masses: array<Mass, COMPONENTS>;
        var likelihood = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            masses[k] = mass_around(value, mixture[k]);
            likelihood += mixture[k].weight * masses[k].mass;
        }
        // Below the bound only a step that raises the likelihood counts.
        let counts = likelihood >= parameters.bound || slope < 0.0;
        let by_likelihood = select(0.0, slope / max(likelihood, parameters.bound), counts);
        var of_value = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            let weighted = by_likelihood * mixture[k].weight;
            let by_distance = weighted * masses[k].by_distance;
            let by_half_width = weighted * masses[k].by_half_width;
            of_value += by_distance * mixture[k].inverse_scale;
            sums[0] += 0.5 * by_half_width * mixture[k].inverse_scale;
            sums[1u + k] += weighted * (masses[k].mass - likelihood);
            sums[1u + COMPONENTS + k] -= by_distance * mixture[k].inverse_scale;
            sums[1u + 2u * COMPONENTS + k] -=
                by_distance * masses[k].distance + by_half_width * mixture[k].half_width;
        }
        of_values[channel * parameters.count + i] = of_value;
    }
    partial[lane] = sums;
    workgroupBarrier();
    for (var own = lane; own < SUMS; own += WORKGROUP) {
        var total = 0.0;
        for (var k = 0u; k < WORKGROUP; k++) {
            total += partial[k][own];
        }
        if (own == 0u) {
            of_mixture[parameters.starts.x + channel] = total;
        } else {
            let k = own - 1u;
            let start = parameters.starts[1u + k / COMPONENTS];
            of_mixture[start + channel * COMPONENTS + k % COMPONENTS] = total;
        }
    }
}
