// Second half of the regularizer of control nodes: the loss, and all gradients.
//
// One invocation owns one node, and all knots of its trajectory. Reads the sums of `node_strain.wgsl` and the knots. Writes the loss, and into
// one buffer the gradients of anchors [B, 3], translations [K, 3 B] and rotations [K, 4 B], each at its own offset.

// #include node_spline

struct Parameters {
    spline: Spline,
    rigidity: f32,
    smoothness_of_translations: f32,
    smoothness_of_rotations: f32,
    // Where the gradients begin; those of the anchors at 0.
    of_translations: u32,
    of_rotations: u32,
}

@group(0) @binding(0) var<storage, read_write> sums: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> translations: array<f32>;
@group(0) @binding(2) var<storage, read_write> rotations: array<f32>;
@group(0) @binding(3) var<storage, read_write> loss: array<f32>;
@group(0) @binding(4) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(5) var<uniform> parameters: Parameters;

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
    let knots = spline.knots;
    let terms = f32((knots - 2u) * spline.nodes);
    let of_move = parameters.smoothness_of_translations / (3.0 * terms);
    let of_bend = parameters.smoothness_of_rotations / (4.0 * terms);
    var strain = 0.0;
    var weights = 0.0;
    var bends = vec2<f32>(0.0);
    for (var other = 0u; other < spline.nodes; other++) {
        strain += sums[4u * other].w;
        weights += sums[4u * other + 1u].w;
        bends += sums[4u * other + 3u].xy;
    }
    let scale = parameters.rigidity / weights;
    if (node == 0u) {
        loss[0] = scale * strain + of_move * bends.x + of_bend * bends.y;
    }
    let of_anchor = scale * sums[4u * node].xyz;
    let of_translation = scale * sums[4u * node + 1u].xyz;
    let of_turn = scale * sums[4u * node + 2u];
    for (var k = 0u; k < 3u; k++) {
        gradients[3u * node + k] = of_anchor[k];
    }

    // Second differences around the knot before, and around the one before that: zeros at the ends.
    var moves = array<vec3<f32>, 2>(vec3<f32>(0.0), vec3<f32>(0.0));
    var turns = array<vec4<f32>, 2>(vec4<f32>(0.0), vec4<f32>(0.0));
    for (var knot = 0u; knot < knots; knot++) {
        var next_move = vec3<f32>(0.0);
        var next_turn = vec4<f32>(0.0);
        if (knot + 2u < knots) {
            next_move = bend_of_translations(spline, knot, node);
            next_turn = bend_of_rotations(spline, knot, node);
        }
        let weight = weight_of_knot(spline, knot);
        let by_translation = weight * of_translation + 2.0 * of_move * (next_move - 2.0 * moves[0] + moves[1]);
        let by_rotation = weight * of_turn + 2.0 * of_bend * (next_turn - 2.0 * turns[0] + turns[1]);
        let row = spline.nodes * knot + node;
        for (var k = 0u; k < 3u; k++) {
            gradients[parameters.of_translations + 3u * row + k] = by_translation[k];
        }
        for (var k = 0u; k < 4u; k++) {
            gradients[parameters.of_rotations + 4u * row + k] = by_rotation[k];
        }
        moves[1] = moves[0];
        moves[0] = next_move;
        turns[1] = turns[0];
        turns[0] = next_turn;
    }
}
