// A pass of a radix sort: moves keys and values to their places. Stable: equal keys keep their order.
//
// A workgroup owns a block of BLOCK keys, an invocation EACH neighboring keys; a digit has RADIX_BITS bits. Reads this pass's table
// in `tables`, the count of each digit in each block (SUMMED: the table holds the prefix sums of these counts;
// otherwise the kernel computes them), and counts the next pass's digits in the blocks that the keys come to, unless
// this pass is the LAST. In the FIRST pass the value of a key is its index.
//
// Counting is atomic; sums of whole numbers do not depend on their order.

struct Parameters {
    count: u32,
    blocks: u32,
    pass_number: u32,
}

@group(0) @binding(0) var<storage, read_write> keys: array<u32>;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> tables: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted_values: array<u32>;
@group(0) @binding(5) var<uniform> parameters: Parameters;

const EACH: u32 = BLOCK / WORKGROUP;
const DIGITS: u32 = 1u << RADIX_BITS;
// Neighboring digits that an invocation looks after.
const OWN: u32 = DIGITS / WORKGROUP;

// For each digit and invocation the place of its next key. There is no room for more in 16 KiB.
var<workgroup> places: array<u32, DIGITS * WORKGROUP>;

fn digit_of(key: u32, pass_number: u32) -> u32 {
    return (key >> (pass_number * RADIX_BITS)) & (DIGITS - 1u);
}

fn table_at(pass_number: u32, digit: u32, block: u32) -> u32 {
    return (pass_number * DIGITS + digit) * parameters.blocks + block;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    let pass_number = parameters.pass_number;

    // Where the block's keys of each own digit begin: behind those of smaller digits, and of earlier blocks.
    var starts: array<u32, OWN>;
    if (SUMMED == 1u) {
        if (block < parameters.blocks) {
            for (var own = 0u; own < OWN; own++) {
                starts[own] = atomicLoad(&tables[table_at(pass_number, lane * OWN + own, block)]);
            }
        }
    } else {
        var sum = 0u;
        for (var own = 0u; own < OWN; own++) {
            starts[own] = sum;
            for (var other = 0u; other < parameters.blocks; other++) {
                let keys_there = atomicLoad(&tables[table_at(pass_number, lane * OWN + own, other)]);
                sum += keys_there;
                starts[own] += select(0u, keys_there, other < block);
            }
        }
        places[lane] = sum;
        workgroupBarrier();
        var before = 0u;
        for (var other = 0u; other < lane; other++) {
            before += places[other];
        }
        for (var own = 0u; own < OWN; own++) {
            starts[own] += before;
        }
        workgroupBarrier();
    }

    for (var digit = 0u; digit < DIGITS; digit++) {
        places[digit * WORKGROUP + lane] = 0u;
    }
    let first = block * BLOCK + lane * EACH;
    let end = min(first + EACH, parameters.count);
    for (var k = first; k < end; k++) {
        places[digit_of(keys[k], pass_number) * WORKGROUP + lane] += 1u;
    }
    workgroupBarrier();
    for (var own = 0u; own < OWN; own++) {
        let digit = lane * OWN + own;
        var place = starts[own];
        for (var member = 0u; member < WORKGROUP; member++) {
            let keys_there = places[digit * WORKGROUP + member];
            places[digit * WORKGROUP + member] = place;
            place += keys_there;
        }
    }
    workgroupBarrier();

    for (var k = first; k < end; k++) {
        let key = keys[k];
        let at = digit_of(key, pass_number) * WORKGROUP + lane;
        let place = places[at];
        places[at] = place + 1u;
        sorted_keys[place] = key;
        if (FIRST == 1u) {
            sorted_values[place] = k;
        } else {
            sorted_values[place] = values[k];
        }
        if (LAST == 0u) {
            let next = pass_number + 1u;
            atomicAdd(&tables[table_at(next, digit_of(key, next), place / BLOCK)], 1u);
        }
    }
}
