// Probability of the unit interval around each value under its normal distribution.
//
// Each invocation computes one value. It reads `values`, `means` and `scales`, and writes `likelihoods`.

// #include exponential, normal

struct Parameters {
    count: u32,
    // Standard deviations and probabilities below these are raised to them.
    scale_bound: f32,
    likelihood_bound: f32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> means: array<f32>;
@group(0) @binding(2) var<storage, read_write> scales: array<f32>;
@group(0) @binding(3) var<storage, read_write> likelihoods: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.count) {
        return;
    }
    let edges = edges_of(values[i] - means[i], max(scales[i], parameters.scale_bound));
    likelihoods[i] = max(mass_between(edges), parameters.likelihood_bound);
}
