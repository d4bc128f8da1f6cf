// Some columns of a matrix in their place, and zeros elsewhere.
//
// Each invocation computes one number. It reads `columns` [rows, count] and writes `matrix` [rows, width].

struct Parameters {
    // Numbers of the matrix.
    size: u32,
    width: u32,
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> columns: array<f32>;
@group(0) @binding(1) var<storage, read_write> matrix: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.size) {
        return;
    }
    let column = i % parameters.width;
    var value = 0.0;
    if (column >= parameters.first && column - parameters.first < parameters.count) {
        value = columns[i / parameters.width * parameters.count + column - parameters.first];
    }
    matrix[i] = value;
}
