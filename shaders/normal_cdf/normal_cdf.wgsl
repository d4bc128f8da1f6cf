// The standard normal distribution function, by Chebyshev's fit of erfc with a small relative error everywhere (Press et
// al., Numerical Recipes, section 6.2): the coefficients and the order of operations of `light4gs-model/src/ops/normal_cdf/cpu.rs`.
//
// Each invocation computes one value. It reads `places` and writes `probabilities`.

// #include exponential

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> places: array<f32>;
@group(0) @binding(1) var<storage, read_write> probabilities: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

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
    let x = places[i];
    // With z = |x| / sqrt 2: t = 1 / (1 + z / 2), and erfc(z) = t exp(polynomial(t) - z²).
    let t = 1.0 / (1.0 + 0.35355339 * abs(x));
    var polynomial = 0.17087277 * t;
    polynomial = (polynomial - 0.82215223) * t;
    polynomial = (polynomial + 1.48851587) * t;
    polynomial = (polynomial - 1.13520398) * t;
    polynomial = (polynomial + 0.27886807) * t;
    polynomial = (polynomial - 0.18628806) * t;
    polynomial = (polynomial + 0.09678418) * t;
    polynomial = (polynomial + 0.37409196) * t;
    polynomial = (polynomial + 1.00002368) * t;
    // Not above 0, except for rounding: at x = 0 it is -9e-8.
    let exponent = (polynomial - 1.26551223) - 0.5 * x * x;
    let lower_tail = 0.5 * t * exponential(exponent);
    probabilities[i] = select(lower_tail, 1.0 - lower_tail, x >= 0.0);
}
