// The members of a team communicate through subgroup operations: it is exactly one subgroup. `team_uniform` is in
// `agreed.wgsl` or `trusted.wgsl`, `team_sum` in `sum_of_few.wgsl` and `sum_of_many.wgsl`.

var<private> held: array<vec4<f32>, 3>;

// Makes three vectors of every member readable for the team, until the next call.
fn team_share(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, lane: u32) {
    held[0] = a;
    held[1] = b;
    held[2] = c;
}

// Vector `which` of a member; the same member for all.
fn team_read(which: u32, member: u32) -> vec4<f32> {
    return subgroupShuffle(held[which], member);
}

fn team_any(condition: bool, lane: u32) -> bool {
    return team_uniform(u32(subgroupAny(condition)), lane) != 0u;
}
