// Derivatives of the probability of a unit interval, or of its bits, times the upstream gradient. Below a bound a gradient passes only where a descent
// step raises the number (Ballé et al. 2018).
//
// Each invocation computes one value. It reads `values`, `parameters`, all standard deviations and then all means, and `upstream`, and
// writes the gradients of the first two.

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
@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> of_values: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_parameters: array<f32>;
@group(0) @binding(5) var<uniform> bounds: Bounds;

fn through_bound(value: f32, bound: f32, gradient: f32) -> f32 {
    return select(gradient, 0.0, value < bound && gradient >= 0.0);
}

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
    let scale = raised(parameters[i], bounds.scale);
    let edges = edges_of(offset, scale);
    let likelihood = mass_between(edges);
    let by_bits = -1.44269504 / raised(likelihood, bounds.likelihood);
    let of_likelihood = upstream[i] * select(1.0, by_bits, bounds.in_bits != 0u);
    let gradient = through_bound(likelihood, bounds.likelihood, of_likelihood);
    let upper = normal_density(edges.x);
    let lower = normal_density(edges.y);
    // The distance from the mean is -|offset|; at the mean the derivative is 0.
    let by_distance = gradient * (upper - lower) / scale;
    let of_value = select(by_distance, -by_distance, offset > 0.0);
    of_values[i] = of_value;
    of_parameters[bounds.count + i] = -of_value;
    of_parameters[i] = through_bound(parameters[i], bounds.scale, gradient * (lower * edges.y - upper * edges.x) / scale);
}
