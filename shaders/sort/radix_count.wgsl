// Beginning of a radix sort: the count of each digit of the first pass in each block.
//
// A workgroup owns a block of BLOCK keys, an invocation EACH neighboring keys; a digit has RADIX_BITS bits. Writes
// `tables[digit * blocks + block]`, and zeros to the tables of the PASSES - 1 further passes, which `radix_scatter` counts for.

struct Parameters {
    count: u32,
    blocks: u32,
}

@group(0) @binding(0) var<storage, read_write> keys: array<u32>;
@group(0) @binding(1) var<storage, read_write> tables: array<u32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

const EACH: u32 = BLOCK / WORKGROUP;
const DIGITS: u32 = 1u << RADIX_BITS;

// A counter for each digit and invocation, so that no atomics are needed.
var<workgroup> counters: array<u32, DIGITS * WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    for (var digit = 0u; digit < DIGITS; digit++) {
        counters[digit * WORKGROUP + lane] = 0u;
    }
    let first = block * BLOCK + lane * EACH;
    for (var k = first; k < min(first + EACH, parameters.count); k++) {
        let digit = keys[k] & (DIGITS - 1u);
        counters[digit * WORKGROUP + lane] += 1u;
    }
    workgroupBarrier();
    if (block >= parameters.blocks) {
        return;
    }
    for (var digit = lane; digit < DIGITS; digit += WORKGROUP) {
        var sum = 0u;
        for (var member = 0u; member < WORKGROUP; member++) {
            sum += counters[digit * WORKGROUP + member];
        }
        let at = digit * parameters.blocks + block;
        tables[at] = sum;
        for (var pass_number = 1u; pass_number < PASSES; pass_number++) {
            tables[pass_number * DIGITS * parameters.blocks + at] = 0u;
        }
    }
}
