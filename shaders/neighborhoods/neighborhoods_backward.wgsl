// Derivative of rows of tables and their neighbors: every number of a table adds up its gradients.
//
// One invocation owns one number of the tables, which have N rows and C columns together. Its row was chosen at `places[starts[row]..starts[row + 1]]`, where the first M
// places are those of the rows themselves; the sum is in their order.

// #include tables

struct Parameters {
    // N, C, M, neighbors of each row
    rows: u32,
    columns: u32,
    count: u32,
    neighbors: u32,
    tables: Tables,
}

@group(0) @binding(0) var<storage, read_write> starts: array<u32>;
@group(0) @binding(1) var<storage, read_write> places: array<u32>;
@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    let columns = parameters.columns;
    let count = parameters.count;
    if (i >= parameters.rows * columns) {
        return;
    }
    let row = i / columns;
    let column = i % columns;
    var sum = 0.0;
    for (var k = starts[row]; k < starts[row + 1u]; k++) {
        let place = places[k];
        if (place < count) {
            sum += upstream[column * count + place];
        } else {
            let neighbor = place - count;
            let m = neighbor / parameters.neighbors;
            var own = upstream[(columns + column) * count + m] / f32(parameters.neighbors);
            if (neighbor % parameters.neighbors == 0u) {
                own += upstream[(2u * columns + column) * count + m];
            }
            sum += own;
        }
    }
    sums[place_of(table_of(column), row, column)] = sum;
}
