// Derivatives of the probability of a unit interval, times the upstream gradient. Below a bound a gradient passes only where a descent
// step raises the number (Ballé et al. 2018).
//
// Each invocation computes one value. It reads `values`, `means`, `scales` and `upstream`, and writes the gradients of the first three.

// #include exponential, normal

struct Parameters {
    count: u32,
    scale_bound: f32,
    likelihood_bound: f32,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> means: array<f32>;
@group(0) @binding(2) var<storage, read_write> scales: array<f32>;
@group(0) @binding(3) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_values: array<f32>;
@group(0) @binding(5) var<storage, read_write> of_means: array<f32>;
@group(0) @binding(6) var<storage, read_write> of_scales: array<f32>;
@group(0) @binding(7) var<uniform> parameters: Parameters;

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
    if (i >= parameters.count) {
        return;
    }
    let offset = values[i] - means[i];
    let scale = max(scales[i], parameters.scale_bound);
    let edges = edges_of(offset, scale);
    let gradient = through_bound(mass_between(edges), parameters.likelihood_bound, upstream[i]);
    let upper = normal_density(edges.x);
    let lower = normal_density(edges.y);
    // The distance from the mean is -|offset|; at the mean the derivative is 0.
    let by_distance = gradient * (upper - lower) / scale;
    let of_value = select(by_distance, -by_distance, offset > 0.0);
    of_values[i] = of_value;
    of_means[i] = -of_value;
    of_scales[i] =
        through_bound(scales[i], parameters.scale_bound, gradient * (lower * edges.y - upper * edges.x) / scale);
}
