// Derivative of rows of a table: every number of the table adds up its gradients.
//
// One invocation owns one number of the table [N, C]. Its row was chosen at `places[starts[row]..starts[row + 1]]`; the sum is in
// their order.

struct Parameters {
    // N, C, M
    rows: u32,
    columns: u32,
    chosen: u32,
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
    if (i >= parameters.rows * parameters.columns) {
        return;
    }
    let row = i / parameters.columns;
    var sum = 0.0;
    for (var k = starts[row]; k < starts[row + 1u]; k++) {
        sum += upstream[i % parameters.columns * parameters.chosen + places[k]];
    }
    sums[i] = sum;
}
