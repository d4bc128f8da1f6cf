// Scales and opacities of Gaussians, from their logarithms and logits if LOGARITHMS is 1.

fn scale_of(place: vec3<f32>) -> vec3<f32> {
    if (LOGARITHMS == 0u) {
        return place;
    }
    return vec3<f32>(bounded_exponential(place.x), bounded_exponential(place.y), bounded_exponential(place.z));
}

fn opacity_of(place: f32) -> f32 {
    if (LOGARITHMS == 0u) {
        return place;
    }
    return sigmoid(place);
}
