// Sum over a large team that is a subgroup: by halves, in the same order in every run.
fn team_sum(value: vec4<f32>, lane: u32) -> vec4<f32> {
    var sum = value;
    for (var step = TEAM / 2u; step > 0u; step = step / 2u) {
        sum += subgroupShuffleXor(sum, step);
    }
    return sum;
}
