// A splat's alpha at four pixels of a column.

struct Footprint {
    // After the clamp at MAX_ALPHA.
    alpha: vec4<f32>,
    // Whether alpha is not below the threshold.
    hit: vec4<bool>,
    // Not clamped, so that it still depends on the splat.
    free: vec4<bool>,
}

// `dx` and `dy` are the offsets from the pixels to the center.
fn footprint(conic: vec3<f32>, opacity: f32, dx: f32, dy: vec4<f32>) -> Footprint {
    let power = (-0.5 * conic.z * dy) * dy + (-0.5 * conic.x * dx * dx - conic.y * dx * dy);
    let raw = opacity * exp(power);
    let alpha = min(raw, vec4<f32>(MAX_ALPHA));
    return Footprint(
        alpha,
        (alpha >= vec4<f32>(MIN_ALPHA)) & (power <= vec4<f32>(0.0)),
        raw <= vec4<f32>(MAX_ALPHA),
    );
}
