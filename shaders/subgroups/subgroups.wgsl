// Counts the invocations that are really in one subgroup, of a workgroup that is meant to be one. Run once a device,
// since a workgroup of the size that an adapter reports need not be one subgroup.
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
