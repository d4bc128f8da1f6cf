// Values on which a team (a workgroup of TEAM invocations that blends one cell) agrees, in a form that every compiler
// knows to be uniform, that is, the same for all members. Barriers and subgroup operations may only stand in control
// flow that depends on nothing else: the strict compilers (that of Chromium, for one) refuse all other kernels. Values
// from a storage buffer that can be written count as different, and so do sums over workgroup memory.

var<workgroup> agreed: u32;

// The value of the first member.
fn team_uniform(value: u32, lane: u32) -> u32 {
    if (lane == 0u) {
        agreed = value;
    }
    return workgroupUniformLoad(&agreed);
}
