// First half of the regularizer of control nodes: the distances of nodes from the places where their neighbors see them
// (as rigid as possible, Sorkine and Alexa 2007), and the bending of trajectories.
//
// One invocation owns one node and meets all others, as the one that sees and as the one that is seen. Reads the nodes. Writes four
// vectors of `sums`; the first three are not yet divided by the sum of the weights of all nodes:
//
//   0: derivative by the anchor; the strain
//   1: derivative by the translation; the sum of the weights
//   2: derivative by the spline of the rotations
//   3: sums of the squared second differences of the knots: translations, rotations

// #include exponential, quaternion, node_spline, node_motion

@group(0) @binding(0) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(1) var<storage, read_write> log_radii: array<f32>;
@group(0) @binding(2) var<storage, read_write> translations: array<f32>;
@group(0) @binding(3) var<storage, read_write> rotations: array<f32>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4<f32>>;
@group(0) @binding(5) var<uniform> spline: Spline;

// The weight of a neighbor at a squared distance, for node `node`.
fn weight_at(node: u32, squared: f32) -> f32 {
    return exponential(-0.25 * exp(-2.0 * log_radii[node]) * squared);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= spline.nodes) {
        return;
    }
    let anchor = anchor_at(own);
    let motion = motion_of(spline, own);
    let rotation = rotation_of(motion.turn);
    var strain = 0.0;
    var weights = 0.0;
    var of_anchor = vec3<f32>(0.0);
    var of_translation = vec3<f32>(0.0);
    var of_rotation = Rotation(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    for (var other = 0u; other < spline.nodes; other++) {
        let of_other = motion_of(spline, other);
        let rotation_of_other = rotation_of(of_other.turn);
        let before = anchor_at(other) - anchor;
        let now = before + of_other.translation - motion.translation;
        let squared = dot(before, before);
        let weight = weight_at(own, squared);
        let off = now - turned(rotation, before);
        let by_off = 2.0 * weight * off;
        strain += weight * dot(off, off);
        weights += weight;
        of_rotation.axis_x -= by_off * before.x;
        of_rotation.axis_y -= by_off * before.y;
        of_rotation.axis_z -= by_off * before.z;
        // The other sees this one on the other side.
        let by_its_off = 2.0 * weight_at(other, squared) * (turned(rotation_of_other, before) - now);
        of_translation += by_its_off - by_off;
        of_anchor += turned_back(rotation, by_off) - turned_back(rotation_of_other, by_its_off);
    }
    let of_turn = rotation_backward(
        motion.turn, motion.norm, of_rotation.axis_x, of_rotation.axis_y, of_rotation.axis_z
    );
    var bends = vec2<f32>(0.0);
    for (var knot = 0u; knot + 2u < spline.knots; knot++) {
        let bend_of_move = bend_of_translations(spline, knot, own);
        let bend_of_turn = bend_of_rotations(spline, knot, own);
        bends += vec2<f32>(dot(bend_of_move, bend_of_move), dot(bend_of_turn, bend_of_turn));
    }
    sums[4u * own] = vec4<f32>(of_anchor + of_translation, strain);
    sums[4u * own + 1u] = vec4<f32>(of_translation, weights);
    sums[4u * own + 2u] = of_turn;
    sums[4u * own + 3u] = vec4<f32>(bends, 0.0, 0.0);
}
