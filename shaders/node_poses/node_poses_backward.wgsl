// Derivative of the poses of control nodes.
//
// One invocation owns one node, and all knots of its trajectory. Reads `upstream` [B, 20 + AFFINITIES], see `node_poses.wgsl`. Writes the
// gradients of anchors [B, 3], log_radii [B, 1], translations [K, 3 B], rotations [K, 4 B] and affinities [B, AFFINITIES] into one buffer,
// each at its own offset.

// #include quaternion, node_spline, node_motion

struct Parameters {
    spline: Spline,
    // Where the gradients begin; those of the anchors at 0.
    of_log_radii: u32,
    of_translations: u32,
    of_rotations: u32,
    of_affinities: u32,
}

@group(0) @binding(0) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(1) var<storage, read_write> log_radii: array<f32>;
@group(0) @binding(2) var<storage, read_write> translations: array<f32>;
@group(0) @binding(3) var<storage, read_write> rotations: array<f32>;
@group(0) @binding(4) var<storage, read_write> unit: array<f32>;
@group(0) @binding(5) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(6) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(7) var<uniform> parameters: Parameters;

fn upstream_at(at: u32) -> vec3<f32> {
    return vec3<f32>(upstream[at], upstream[at + 1u], upstream[at + 2u]);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let node = flat_group(group, groups) * WORKGROUP + lane;
    let spline = parameters.spline;
    if (node >= spline.nodes) {
        return;
    }
    let at = (20u + AFFINITIES) * node;
    let anchor = anchor_at(node);
    let motion = motion_of(spline, node);
    let rotation = rotation_of(motion.turn);
    // offset = anchor + translation - R anchor, times the unit
    let of_offset = upstream_at(at + 13u) * unit[0];
    let row_x = upstream_at(at + 4u) - of_offset.x * anchor;
    let row_y = upstream_at(at + 7u) - of_offset.y * anchor;
    let row_z = upstream_at(at + 10u) - of_offset.z * anchor;
    let of_rotation = rotation_backward(
        motion.turn,
        motion.norm,
        vec3<f32>(row_x.x, row_y.x, row_z.x),
        vec3<f32>(row_x.y, row_y.y, row_z.y),
        vec3<f32>(row_x.z, row_y.z, row_z.z),
    );
    let of_quat = vec4<f32>(upstream[at + 16u], upstream[at + 17u], upstream[at + 18u], upstream[at + 19u]);
    let of_turn = of_rotation + (of_quat - sum_of_products(of_quat, motion.turn) * motion.turn) / motion.norm;
    let of_anchor = upstream_at(at) * unit[0] + of_offset - turned_back(rotation, of_offset);
    for (var k = 0u; k < 3u; k++) {
        gradients[3u * node + k] = of_anchor[k];
    }
    let precision_of_node = exp(-2.0 * log_radii[node]) / (2.0 * unit[0] * unit[0]);
    gradients[parameters.of_log_radii + node] = -2.0 * precision_of_node * upstream[at + 3u];
    for (var knot = 0u; knot < spline.knots; knot++) {
        let weight = weight_of_knot(spline, knot);
        let row = spline.nodes * knot + node;
        for (var k = 0u; k < 3u; k++) {
            gradients[parameters.of_translations + 3u * row + k] = weight * of_offset[k];
        }
        for (var k = 0u; k < 4u; k++) {
            gradients[parameters.of_rotations + 4u * row + k] = weight * of_turn[k];
        }
    }
    for (var k = 0u; k < AFFINITIES; k++) {
        gradients[parameters.of_affinities + AFFINITIES * node + k] = upstream[at + 20u + k];
    }
}
