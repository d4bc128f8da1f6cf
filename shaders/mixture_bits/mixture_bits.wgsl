// Bits of the values of a channel under its mixture of logistics.
//
// A workgroup owns a channel. Each of its invocations takes every WORKGROUP-th value; the first adds up their sums, in order.

// #include exponential, mixture

struct Parameters {
    channels: u32,
    // Values of a channel.
    count: u32,
    // Likelihoods below this are raised to it.
    bound: f32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> widths: array<f32>;
@group(0) @binding(2) var<storage, read_write> weight_logits: array<f32>;
@group(0) @binding(3) var<storage, read_write> means: array<f32>;
@group(0) @binding(4) var<storage, read_write> log_scales: array<f32>;
@group(0) @binding(5) var<storage, read_write> bits: array<f32>;
@group(0) @binding(6) var<uniform> parameters: Parameters;

var<workgroup> partial: array<f32, WORKGROUP>;

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
    var sum = 0.0;
    for (var i = lane; i < parameters.count; i += WORKGROUP) {
        let value = values[channel * parameters.count + i];
        var likelihood = 0.0;
        for (var k = 0u; k < COMPONENTS; k++) {
            likelihood += mixture[k].weight * mass_around(value, mixture[k]).mass;
        }
        sum -= log2(max(likelihood, parameters.bound));
    }
    partial[lane] = sum;
    workgroupBarrier();
    if (lane == 0u) {
        var total = 0.0;
        for (var k = 0u; k < WORKGROUP; k++) {
            total += partial[k];
        }
        bits[channel] = total;
    }
}
