// Knots of the splines of control nodes, `translations` [K, 3 B] and `rotations` [K, 4 B] (quaternions minus (1, 0, 0,
// 0)), and the weights of the four knots that count at a time.

struct Spline {
    // B
    nodes: u32,
    // K
    knots: u32,
    // The first of the four knots, and the weight of each.
    first: u32,
    weight_0: f32,
    weight_1: f32,
    weight_2: f32,
    weight_3: f32,
    // A structure within a uniform takes a multiple of 16 bytes.
    unused: u32,
}

fn weights_of(spline: Spline) -> vec4<f32> {
    return vec4<f32>(spline.weight_0, spline.weight_1, spline.weight_2, spline.weight_3);
}

// The weight of a knot.
fn weight_of_knot(spline: Spline, knot: u32) -> f32 {
    if (knot < spline.first || knot >= spline.first + 4u) {
        return 0.0;
    }
    let weights = weights_of(spline);
    return weights[knot - spline.first];
}

fn translation_at(spline: Spline, knot: u32, node: u32) -> vec3<f32> {
    let at = 3u * (spline.nodes * knot + node);
    return vec3<f32>(translations[at], translations[at + 1u], translations[at + 2u]);
}

fn rotation_at(spline: Spline, knot: u32, node: u32) -> vec4<f32> {
    let at = 4u * (spline.nodes * knot + node);
    return vec4<f32>(rotations[at], rotations[at + 1u], rotations[at + 2u], rotations[at + 3u]);
}

// The second differences of the knots from `knot` on.
fn bend_of_translations(spline: Spline, knot: u32, node: u32) -> vec3<f32> {
    let ends = translation_at(spline, knot, node) + translation_at(spline, knot + 2u, node);
    return ends - 2.0 * translation_at(spline, knot + 1u, node);
}

fn bend_of_rotations(spline: Spline, knot: u32, node: u32) -> vec4<f32> {
    let ends = rotation_at(spline, knot, node) + rotation_at(spline, knot + 2u, node);
    return ends - 2.0 * rotation_at(spline, knot + 1u, node);
}
