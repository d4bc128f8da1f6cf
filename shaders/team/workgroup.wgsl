// The members of a team communicate through workgroup memory: for adapters without subgroup operations, or whose
// subgroups have no fixed size. `team_uniform` is in `agreed.wgsl`.

var<workgroup> lent: array<vec4<f32>, 3 * TEAM>;
var<workgroup> exchanged: array<vec4<f32>, TEAM>;
var<workgroup> votes: array<u32, TEAM>;

// Makes three vectors of every member readable for the team, until the next call.
fn team_share(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, lane: u32) {
    workgroupBarrier();
    lent[lane] = a;
    lent[TEAM + lane] = b;
    lent[2u * TEAM + lane] = c;
    workgroupBarrier();
}

// Vector `which` of a member; the same member for all.
fn team_read(which: u32, member: u32) -> vec4<f32> {
    return lent[which * TEAM + member];
}

// Sum over the team, in the order of its members.
fn team_sum(value: vec4<f32>, lane: u32) -> vec4<f32> {
    workgroupBarrier();
    exchanged[lane] = value;
    workgroupBarrier();
    var sum = exchanged[0];
    for (var member = 1u; member < TEAM; member++) {
        sum += exchanged[member];
    }
    return sum;
}

// The first member counts the votes. It has read all of them before anybody leaves `team_uniform`, and votes again.
fn team_any(condition: bool, lane: u32) -> bool {
    votes[lane] = u32(condition);
    workgroupBarrier();
    var any = 0u;
    if (lane == 0u) {
        for (var member = 0u; member < TEAM; member++) {
            any |= votes[member];
        }
    }
    return team_uniform(any, lane) != 0u;
}
