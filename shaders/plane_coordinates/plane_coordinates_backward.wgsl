// The derivative of `plane_coordinates` by the points.
//
// One invocation owns one point. Reads what the forward pass read, and `upstream` [N, width]; writes `gradients` [N, 3].

// #include contraction

@group(0) @binding(0) var<storage, read_write> points: array<f32>;
@group(0) @binding(1) var<storage, read_write> mean: array<f32>;
@group(0) @binding(2) var<storage, read_write> axes: array<f32>;
@group(0) @binding(3) var<storage, read_write> deviations: array<f32>;
@group(0) @binding(4) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(5) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(6) var<uniform> mapping: Mapping;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= mapping.count) {
        return;
    }
    let at = 3u * i;
    let from_row = mapping.width * i;
    let point = vec3<f32>(points[at], points[at + 1u], points[at + 2u]);
    let place = standardized(point - vec3<f32>(mean[0], mean[1], mean[2]));
    var gradient =
        vec3<f32>(upstream[from_row], upstream[from_row + 1u], upstream[from_row + 2u]) * mapping.scale;
    if (mapping.contracts != 0u) {
        let inverse = inverse_radius(place);
        // The radius has a derivative outside of the unit ball only, where the contraction bends.
        let along = select(0.0, dot(gradient, place) * (2.0 * inverse - 2.0) * inverse * inverse * inverse, inverse < 1.0);
        gradient = gradient * ((2.0 - inverse) * inverse) + along * place;
    }
    for (var k = 0u; k < 3u; k++) {
        let row = 3u * k;
        gradients[at + k] =
            gradient.x * axes[row] / deviations[0] + gradient.y * axes[row + 1u] / deviations[1] + gradient.z * axes[row + 2u] / deviations[2];
    }
}
