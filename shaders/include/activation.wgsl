// The activations of scales and opacities.

fn bounded_exponential(x: f32) -> f32 {
    // Not the builtin minimum, which may turn NaN into a number.
    return exponential(select(x, MAX_LOGARITHM, x > MAX_LOGARITHM));
}

fn sigmoid(x: f32) -> f32 {
    // Of -|x|, where nothing overflows.
    let small = exponential(-abs(x));
    return select(small, 1.0, x >= 0.0) / (1.0 + small);
}
