// Rows of a table [N, C], in any order, each as a column of the result [C, M].
//
// One invocation owns one number of the result.

struct Parameters {
    // M, C
    chosen: u32,
    columns: u32,
}

@group(0) @binding(0) var<storage, read_write> rows: array<u32>;
@group(0) @binding(1) var<storage, read_write> table: array<f32>;
@group(0) @binding(2) var<storage, read_write> gathered: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.chosen * parameters.columns) {
        return;
    }
    gathered[i] = table[rows[i % parameters.chosen] * parameters.columns + i / parameters.chosen];
}
