// Control nodes at a time: their poses, and the other values that skinning reads.
//
// One invocation owns one node. Reads its parameters; lengths are shares of `unit`. Writes `posed` [B, 20 + AFFINITIES]: anchor (3) and
// precision (1), world units, pose (16): matrix row by row, offset, quaternion; affinities.

// #include quaternion, node_spline, node_motion

@group(0) @binding(0) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(1) var<storage, read_write> log_radii: array<f32>;
@group(0) @binding(2) var<storage, read_write> translations: array<f32>;
@group(0) @binding(3) var<storage, read_write> rotations: array<f32>;
@group(0) @binding(4) var<storage, read_write> affinities: array<f32>;
@group(0) @binding(5) var<storage, read_write> unit: array<f32>;
@group(0) @binding(6) var<storage, read_write> posed: array<f32>;
@group(0) @binding(7) var<uniform> spline: Spline;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let node = flat_group(group, groups) * WORKGROUP + lane;
    if (node >= spline.nodes) {
        return;
    }
    let anchor = anchor_at(node);
    let motion = motion_of(spline, node);
    let rotation = rotation_of(motion.turn);
    let offset = (anchor + motion.translation - turned(rotation, anchor)) * unit[0];
    let at = (20u + AFFINITIES) * node;
    posed[at + 3u] = exp(-2.0 * log_radii[node]) / (2.0 * unit[0] * unit[0]);
    for (var k = 0u; k < 3u; k++) {
        posed[at + k] = anchor[k] * unit[0];
        posed[at + 4u + 3u * k] = rotation.axis_x[k];
        posed[at + 5u + 3u * k] = rotation.axis_y[k];
        posed[at + 6u + 3u * k] = rotation.axis_z[k];
        posed[at + 13u + k] = offset[k];
    }
    for (var k = 0u; k < 4u; k++) {
        posed[at + 16u + k] = motion.turn[k];
    }
    // Without affinities this is a placeholder: every binding must be used.
    for (var k = 0u; k < AFFINITIES; k++) {
        posed[at + 20u + k] = affinities[AFFINITIES * node + k];
    }
}
