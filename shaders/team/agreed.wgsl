// What a team (a workgroup of TEAM invocations that blends one cell) agrees on, in a form of which every compiler knows
// that it is the same for all members. Barriers and subgroup operations may only stand in control flow that depends on
// nothing else: the strict compilers (that of Chromium, for one) refuse all other kernels. What a kernel reads from a
// storage buffer that can be written counts as different, and so do sums over workgroup memory.

var<workgroup> agreed: u32;

// The value of the first member.
fn team_uniform(value: u32, lane: u32) -> u32 {
    if (lane == 0u) {
        agreed = value;
    }
    return workgroupUniformLoad(&agreed);
}
