// Values on which a team agrees, for Mesa's software driver alone: there `workgroupUniformLoad` takes a fifth of a
// kernel's time. The values are the same for all members, but no compiler knows, so browsers take this only with the
// directive `diagnostic(off, subgroup_uniformity);`.

// The value of the first member, which is that of all.
fn team_uniform(value: u32, lane: u32) -> u32 {
    return value;
}
