// Translation and rotation of a control node at a time, and its place at rest, `anchors` [B, 3].

struct Motion {
    translation: vec3<f32>,
    // A unit quaternion, and the length that it had.
    turn: vec4<f32>,
    norm: f32,
}

fn anchor_at(node: u32) -> vec3<f32> {
    return vec3<f32>(anchors[3u * node], anchors[3u * node + 1u], anchors[3u * node + 2u]);
}

fn motion_of(spline: Spline, node: u32) -> Motion {
    let weights = weights_of(spline);
    var translation = vec3<f32>(0.0);
    var turn = vec4<f32>(0.0);
    for (var k = 0u; k < 4u; k++) {
        translation += weights[k] * translation_at(spline, spline.first + k, node);
        turn += weights[k] * rotation_at(spline, spline.first + k, node);
    }
    turn += vec4<f32>(1.0, 0.0, 0.0, 0.0);
    let norm = sqrt(sum_of_products(turn, turn));
    return Motion(translation, turn / norm, norm);
}

fn turned(by: Rotation, vector: vec3<f32>) -> vec3<f32> {
    return by.axis_x * vector.x + by.axis_y * vector.y + by.axis_z * vector.z;
}

fn turned_back(by: Rotation, vector: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(by.axis_x, vector), dot(by.axis_y, vector), dot(by.axis_z, vector));
}
