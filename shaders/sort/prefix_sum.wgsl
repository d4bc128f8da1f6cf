// Exclusive prefix sum, in place. STEP says which of four launches this is:
//
//   0: a workgroup owns a block of BLOCK values and writes their sum to `sums`;
//   1: a workgroup, the only one, replaces `values` by their prefix sums and writes the total to `sums[0]`;
//   2: a workgroup owns a block and replaces it by its prefix sums, on top of the block's entry of `sums`;
//   3: the same, on top of the sum of the entries of all blocks before it. The last block writes the total to `sums[total_at]`.
//
// Few values need only launch 1, more of them 0 and 3, and very many 0, then 1 over the sums, then 2.

struct Parameters {
    count: u32,
    total_at: u32,
}

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

// Values of one invocation, which are neighbors.
const EACH: u32 = BLOCK / WORKGROUP;

var<workgroup> totals: array<u32, WORKGROUP>;

fn sum_of_own(first: u32) -> u32 {
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        if (first + k < parameters.count) {
            sum += values[first + k];
        }
    }
    return sum;
}

// Writes to `totals` the sums up to and including each invocation's.
fn scan_totals(own: u32, lane: u32) {
    workgroupBarrier();
    totals[lane] = own;
    workgroupBarrier();
    for (var step = 1u; step < WORKGROUP; step = step * 2u) {
        var before = 0u;
        if (lane >= step) {
            before = totals[lane - step];
        }
        workgroupBarrier();
        totals[lane] += before;
        workgroupBarrier();
    }
}

fn replace_own(first: u32, start: u32) {
    var sum = start;
    for (var k = 0u; k < EACH; k++) {
        if (first + k < parameters.count) {
            let value = values[first + k];
            values[first + k] = sum;
            sum += value;
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    if (STEP == 1u) {
        var start = 0u;
        for (var at = 0u; at < parameters.count; at += BLOCK) {
            let first = at + lane * EACH;
            let own = sum_of_own(first);
            scan_totals(own, lane);
            replace_own(first, start + totals[lane] - own);
            start += totals[WORKGROUP - 1u];
        }
        if (lane == 0u) {
            sums[0] = start;
        }
        return;
    }
    var start = 0u;
    if (STEP == 3u) {
        var before = 0u;
        for (var other = lane; other < block; other += WORKGROUP) {
            before += sums[other];
        }
        scan_totals(before, lane);
        start = totals[WORKGROUP - 1u];
    }
    let first = block * BLOCK + lane * EACH;
    let own = sum_of_own(first);
    scan_totals(own, lane);
    if (block * BLOCK >= parameters.count) {
        return;
    }
    if (STEP == 0u) {
        if (lane == 0u) {
            sums[block] = totals[WORKGROUP - 1u];
        }
        return;
    }
    if (STEP == 2u) {
        start = sums[block];
    } else if (lane == 0u && (block + 1u) * BLOCK >= parameters.count) {
        sums[parameters.total_at] = start + totals[WORKGROUP - 1u];
    }
    replace_own(first, start + totals[lane] - own);
}
