// A team is a workgroup of TEAM invocations that blends one cell. Here it is exactly one subgroup.

var<private> held: array<vec4<f32>, 3>;

// Lends three vectors of every member to the team until the next call.
fn team_share(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, lane: u32) {
    held[0] = a;
    held[1] = b;
    held[2] = c;
}

// Vector `which` of a member; the same member for all.
fn team_read(which: u32, member: u32) -> vec4<f32> {
    return subgroupShuffle(held[which], member);
}

// Sum over the team, by halves: the same order in every run.
fn team_sum(value: vec4<f32>, lane: u32) -> vec4<f32> {
    var sum = value;
    for (var step = TEAM / 2u; step > 0u; step = step / 2u) {
        sum += subgroupShuffleXor(sum, step);
    }
    return sum;
}

fn team_any(condition: bool, lane: u32) -> bool {
    return subgroupAny(condition);
}

// A value that is the same for all, known to be so.
fn team_uniform(value: u32, lane: u32) -> u32 {
    return value;
}
