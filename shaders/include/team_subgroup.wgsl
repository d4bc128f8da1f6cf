// A team is a workgroup of TEAM invocations that blends one cell. Here it is exactly one subgroup. `team_sum` is in
// `team_sum_of_few.wgsl` and `team_sum_of_many.wgsl`.

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
    return subgroupAny(condition);
}

// A value that is the same for all members, in a form of which the compiler knows this.
fn team_uniform(value: u32, lane: u32) -> u32 {
    return value;
}
