// A node at one time: a row of `nodes` [B, 20 + AFFINITIES]: anchor (3), precision (1), pose (16), affinities. Those of the Gaussians
// are `affinities` [N, AFFINITIES].

const NODE: u32 = 20u + AFFINITIES;

fn anchor_of(node: u32) -> vec3<f32> {
    let at = NODE * node;
    return vec3<f32>(nodes[at], nodes[at + 1u], nodes[at + 2u]);
}

fn precision_of(node: u32) -> f32 {
    return nodes[NODE * node + 3u];
}

fn pose_of(node: u32) -> Pose {
    let at = NODE * node + 4u;
    return Pose(
        vec4<f32>(nodes[at], nodes[at + 1u], nodes[at + 2u], nodes[at + 9u]),
        vec4<f32>(nodes[at + 3u], nodes[at + 4u], nodes[at + 5u], nodes[at + 10u]),
        vec4<f32>(nodes[at + 6u], nodes[at + 7u], nodes[at + 8u], nodes[at + 11u]),
        vec4<f32>(nodes[at + 12u], nodes[at + 13u], nodes[at + 14u], nodes[at + 15u]),
    );
}

fn affinity_of(node: u32, k: u32) -> f32 {
    return nodes[NODE * node + 20u + k];
}

// The inner product of the affinities of Gaussian `i` and of a node, which is added to the logit of the node's weight.
fn affinity_between(i: u32, node: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < AFFINITIES; k++) {
        sum = fma(affinities[AFFINITIES * i + k], affinity_of(node, k), sum);
    }
    return sum;
}

fn squared_length(v: vec3<f32>) -> f32 {
    return fma(v.x, v.x, fma(v.y, v.y, v.z * v.z));
}

// The logit of a node's weight for Gaussian `i` at a squared distance. Forward and backward must compute the same
// number to the last bit, since a logit may be so large that its rounding is a noticeable weight. A compiler may fuse a
// product and a sum in one kernel and not in another. So every product here that can be in an `fma` is. The last one
// adds a number that is always 0, since no precision is negative, but that a compiler cannot know to be 0: an `fma`
// with a literal 0 is a product, which could be fused with the caller's subtraction.
fn exponent_between(i: u32, node: u32, squared: f32) -> f32 {
    let sharpness = precision_of(node);
    return fma(-sharpness, squared, affinity_between(i, node) + min(sharpness, 0.0));
}
