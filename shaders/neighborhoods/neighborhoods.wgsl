// Some rows of tables with C columns together and their neighbors, each as a column of the result [3 C, M]: the numbers of the row,
// the means over its neighbors, the numbers of the nearest one.
//
// One invocation owns one number of the result.

// #include tables

struct Parameters {
    // M, C, neighbors of each row
    count: u32,
    columns: u32,
    neighbors: u32,
    tables: Tables,
}

// [M], then [M, neighbors], the nearest first
@group(0) @binding(0) var<storage, read_write> rows: array<u32>;
@group(0) @binding(1) var<storage, read_write> numbers: array<f32>;
@group(0) @binding(2) var<storage, read_write> result: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let count = parameters.count;
    let columns = parameters.columns;
    if (i >= 3u * columns * count) {
        return;
    }
    let m = i % count;
    let column = i / count % columns;
    let part = i / count / columns;
    let nearest = count + m * parameters.neighbors;
    let table = table_of(column);
    if (part == 1u) {
        var sum = 0.0;
        for (var k = 0u; k < parameters.neighbors; k++) {
            sum += numbers[place_of(table, rows[nearest + k], column)];
        }
        result[i] = sum / f32(parameters.neighbors);
    } else {
        result[i] = numbers[place_of(table, rows[select(m, nearest, part == 2u)], column)];
    }
}
