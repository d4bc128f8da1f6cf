// Probability of the unit interval around each value under its normal distribution, or its bits.
//
// Each invocation computes one value. It reads `values` and `parameters`, all standard deviations and then all means,
// and writes `measured`.

// #include exponential, normal

struct Bounds {
    count: u32,
    // Standard deviations and probabilities below these are raised to them.
    scale: f32,
    likelihood: f32,
    // Whether bits are asked for in place of probabilities.
    in_bits: u32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(2) var<storage, read_write> measured: array<f32>;
@group(0) @binding(3) var<uniform> bounds: Bounds;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= bounds.count) {
        return;
    }
    let offset = values[i] - parameters[bounds.count + i];
    let edges = edges_of(offset, raised(parameters[i], bounds.scale));
    let likelihood = raised(mass_between(edges), bounds.likelihood);
    measured[i] = select(likelihood, -log2(likelihood), bounds.in_bits != 0u);
}
