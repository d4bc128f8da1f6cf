// A team is a workgroup of TEAM invocations that blends one cell. Here its members communicate through workgroup
// memory: for adapters without subgroup operations, or whose subgroups have no fixed size.

var<workgroup> lent: array<vec4<f32>, 3 * TEAM>;
var<workgroup> exchanged: array<vec4<f32>, TEAM>;
var<workgroup> agreed: u32;

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

fn team_any(condition: bool, lane: u32) -> bool {
    return team_sum(vec4<f32>(f32(condition)), lane).x > 0.0;
}

// A value that is the same for all members, in a form of which the compiler knows this.
fn team_uniform(value: u32, lane: u32) -> u32 {
    workgroupBarrier();
    if (lane == 0u) {
        agreed = value;
    }
    return workgroupUniformLoad(&agreed);
}
