// From world units to the coordinates of the planes: standardized along the principal axes, then contracted.

struct Mapping {
    count: u32,
    // Numbers of a row of the output: 3, or 4 with the time.
    width: u32,
    contracts: u32,
    time: f32,
    scale: vec3<f32>,
    offset: vec3<f32>,
}

// Standardized coordinates of an offset from the mean. `axes` and `deviations` are bindings.
fn standardized(offset: vec3<f32>) -> vec3<f32> {
    var place: vec3<f32>;
    for (var j = 0u; j < 3u; j++) {
        place[j] = (offset.x * axes[j] + offset.y * axes[3u + j] + offset.z * axes[6u + j]) / deviations[j];
    }
    return place;
}

// 1 / max(|place|, 1).
fn inverse_radius(place: vec3<f32>) -> f32 {
    return 1.0 / sqrt(max(dot(place, place), 1.0));
}
