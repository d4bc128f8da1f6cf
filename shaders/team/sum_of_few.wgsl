// Sum over a small team that is a subgroup: member by member, in the same order in every run. On Mesa's software driver
// reading one lane takes two instructions, and an exchange between all lanes thirty times as many.
fn team_sum(value: vec4<f32>, lane: u32) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var member = 0u; member < TEAM; member++) {
        sum += subgroupShuffle(value, member);
    }
    return sum;
}
