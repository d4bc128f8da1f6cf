// The mixture of logistics of a channel, and the mass of the interval around a value. `light4gs-model/src/ops/attribute_bits/cpu_mixture.rs` has the
// formulas.

struct Logistic {
    weight: f32,
    mean: f32,
    inverse_scale: f32,
    half_width: f32,
    // exp(-2 half_width), and 1 minus it.
    shrunk: f32,
    rest: f32,
}

// The mass, and its derivatives by the distance from the mean and by half the width, all in units of the scale.
struct Mass {
    mass: f32,
    distance: f32,
    by_distance: f32,
    by_half_width: f32,
}

// 1 - exp(-x) for x of 0 or more.
fn one_minus_exponential(x: f32) -> f32 {
    if (x < 0.1) {
        return x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0))));
    }
    return 1.0 - exponential(-x);
}

// For intervals of this width.
fn mixture_of(channel: u32, width: f32) -> array<Logistic, COMPONENTS> {
    let own = channel * COMPONENTS;
    var largest = weight_logits[own];
    for (var k = 1u; k < COMPONENTS; k++) {
        largest = max(largest, weight_logits[own + k]);
    }
    var mixture: array<Logistic, COMPONENTS>;
    var sum = 0.0;
    for (var k = 0u; k < COMPONENTS; k++) {
        let inverse_scale = exp(-log_scales[own + k]);
        let half_width = 0.5 * width * inverse_scale;
        let weight = exponential(weight_logits[own + k] - largest);
        sum += weight;
        mixture[k] = Logistic(
            weight,
            means[own + k],
            inverse_scale,
            half_width,
            exponential(-2.0 * half_width),
            one_minus_exponential(2.0 * half_width),
        );
    }
    for (var k = 0u; k < COMPONENTS; k++) {
        mixture[k].weight /= sum;
    }
    return mixture;
}

fn mass_around(value: f32, logistic: Logistic) -> Mass {
    let distance = (value - logistic.mean) * logistic.inverse_scale;
    let beyond = abs(distance);
    let gap = beyond - logistic.half_width;
    let smaller = exponential(-abs(gap));
    let of_width = select(1.0, smaller, gap >= 0.0);
    let of_distance = select(smaller, 1.0, gap >= 0.0);
    let shrunk_distance = exponential(-2.0 * beyond);
    let cosh_width = of_width * (1.0 + logistic.shrunk);
    let cosh_distance = of_distance * (1.0 + shrunk_distance);
    let inverse = 1.0 / (cosh_width + cosh_distance);
    let mass = of_width * logistic.rest * inverse;
    let sinh_distance = of_distance * (1.0 - shrunk_distance) * inverse;
    let product = 4.0 * min(logistic.shrunk, shrunk_distance) + cosh_width * cosh_distance;
    return Mass(
        mass,
        distance,
        mass * select(-sinh_distance, sinh_distance, distance <= 0.0),
        product * inverse * inverse,
    );
}
