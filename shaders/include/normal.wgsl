// The standard normal distribution, with the coefficients and the order of operations of
// `light4gs-model/src/ops/normal_likelihood/cpu.rs`. It needs `exponential.wgsl`.

// The distribution function at x, at most 0, by Chebyshev's fit of erfc with a small relative error everywhere (Press et
// al., Numerical Recipes, section 6.2).
fn lower_tail(x: f32) -> f32 {
    // With z = -x / sqrt 2: t = 1 / (1 + z / 2), and erfc(z) = t exp(polynomial(t) - z²).
    let t = 1.0 / (1.0 - 0.35355339 * x);
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
    return 0.5 * t * exponential((polynomial - 1.26551223) - 0.5 * x * x);
}

fn normal_distribution(x: f32) -> f32 {
    let tail = lower_tail(-abs(x));
    return select(tail, 1.0 - tail, x > 0.0);
}

fn normal_density(x: f32) -> f32 {
    // 1 / sqrt(2 pi)
    return 0.39894228 * exponential(-0.5 * x * x);
}

// The edges of the unit interval at this distance from the mean, in standard deviations, upper and lower, on the lower side of the
// mean, where the distribution function is small and has full precision.
fn edges_of(offset: f32, scale: f32) -> vec2<f32> {
    return (vec2<f32>(0.5, -0.5) - abs(offset)) / scale;
}

// At least the bound; NaN stays NaN, which `max` may hide.
fn raised(value: f32, bound: f32) -> f32 {
    return select(value, bound, value < bound);
}

fn mass_between(edges: vec2<f32>) -> f32 {
    return normal_distribution(edges.x) - normal_distribution(edges.y);
}
