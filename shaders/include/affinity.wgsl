// What the affinities of Gaussian `i` and of a node add to the logit by which the one follows the other. Those of a Gaussian stand
// behind its stillness, `stillness` [N, 1 + AFFINITIES]; those of a node behind its anchor, `anchors` [B, 3 + AFFINITIES].
fn affinity_between(i: u32, node: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < AFFINITIES; k++) {
        sum += stillness[(1u + AFFINITIES) * i + 1u + k] * anchors[(3u + AFFINITIES) * node + 3u + k];
    }
    return sum;
}
