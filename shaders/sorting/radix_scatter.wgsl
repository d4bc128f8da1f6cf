// Second half of a pass of the radix sort: moves keys and values to their places. Stable: equal keys keep their order.
//
// A workgroup owns a block of BLOCK keys, an invocation EACH neighboring keys; a digit has RADIX_BITS bits. Reads the
// prefix sum of the table of `radix_count.wgsl`. In the first pass (FIRST) the value of a key is its index.

struct Parameters {
    count: u32,
    shift: u32,
    blocks: u32,
}

@group(0) @binding(0) var<storage, read_write> keys: array<u32>;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> table: array<u32>;
@group(0) @binding(3) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted_values: array<u32>;
@group(0) @binding(5) var<uniform> parameters: Parameters;

const EACH: u32 = BLOCK / WORKGROUP;
const DIGITS: u32 = 1u << RADIX_BITS;

// For each digit and invocation the place of its next key.
var<workgroup> places: array<u32, DIGITS * WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    for (var digit = 0u; digit < DIGITS; digit++) {
        places[digit * WORKGROUP + lane] = 0u;
    }
    let first = block * BLOCK + lane * EACH;
    let end = min(first + EACH, parameters.count);
    for (var k = first; k < end; k++) {
        let digit = (keys[k] >> parameters.shift) & (DIGITS - 1u);
        places[digit * WORKGROUP + lane] += 1u;
    }
    workgroupBarrier();
    if (block < parameters.blocks) {
        for (var digit = lane; digit < DIGITS; digit += WORKGROUP) {
            var place = table[digit * parameters.blocks + block];
            for (var member = 0u; member < WORKGROUP; member++) {
                let own = places[digit * WORKGROUP + member];
                places[digit * WORKGROUP + member] = place;
                place += own;
            }
        }
    }
    workgroupBarrier();
    for (var k = first; k < end; k++) {
        let key = keys[k];
        let at = ((key >> parameters.shift) & (DIGITS - 1u)) * WORKGROUP + lane;
        let place = places[at];
        places[at] = place + 1u;
        sorted_keys[place] = key;
        if (FIRST == 1u) {
            sorted_values[place] = k;
        } else {
            sorted_values[place] = values[k];
        }
    }
}
