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

// What the affinities of Gaussian `i` and of a node add to the logit by which the one follows the other.
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

// The logit by which Gaussian `i` follows a node that is so far away, in squares. Forward and backward have to find the same number
// to the last bit, since a logit may be so large that its rounding is a noticeable weight. So every product that can be is in an `fma`:
// compilers fuse others or not as they like, one way in one kernel and another way in the next. And so something is added that a compiler
// cannot know to be 0, as no precision is negative: an `fma` with 0 is a product, which it may fuse with what the caller subtracts.
fn exponent_between(i: u32, node: u32, squared: f32) -> f32 {
    let sharpness = precision_of(node);
    return fma(-sharpness, squared, affinity_between(i, node) + min(sharpness, 0.0));
}
