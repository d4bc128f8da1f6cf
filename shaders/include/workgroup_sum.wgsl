// A sum over the invocations of a workgroup, by halves, in the same order in every run.

var<workgroup> totals: array<f32, WORKGROUP>;

// The sum of the values of all invocations; only the first one may use it. Control flow must be uniform.
fn workgroup_sum(value: f32, lane: u32) -> f32 {
    totals[lane] = value;
    workgroupBarrier();
    for (var step = WORKGROUP / 2u; step > 0u; step = step / 2u) {
        if (lane < step) {
            totals[lane] += totals[lane + step];
        }
        workgroupBarrier();
    }
    return totals[0];
}
