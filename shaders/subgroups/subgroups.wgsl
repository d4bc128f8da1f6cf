// Tells how many invocations of a workgroup that is meant to be one subgroup are in one. Asked once a device, since not
// every adapter that has subgroup operations is said to have them.
//
// Writes the number.

@group(0) @binding(0) var<storage, read_write> size: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(local_invocation_index) lane: u32) {
    let members = subgroupAdd(1u);
    let first = subgroupShuffle(lane, 0u);
    if (lane == WORKGROUP - 1u) {
        size[0] = members + first;
    }
}
