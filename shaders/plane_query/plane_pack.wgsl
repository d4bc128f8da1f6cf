// Converts one plane from [C, H · W] to the layout of `include/planes.wgsl`.
//
// Each invocation writes one cell with all its channels; missing channels of the last four become zero.

struct Parameters {
    // Cells of the plane, channels, vectors a cell, first cell in `packed`.
    cells: u32,
    channels: u32,
    quads: u32,
    first_cell: u32,
}

@group(0) @binding(0) var<storage, read_write> plane: array<f32>;
@group(0) @binding(1) var<storage, read_write> packed: array<vec4<f32>>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = flat_group(group, groups) * WORKGROUP + lane;
    if (cell >= parameters.cells) {
        return;
    }
    let first = (parameters.first_cell + cell) * parameters.quads;
    for (var quad = 0u; quad < parameters.quads; quad++) {
        var value = vec4<f32>(0.0);
        for (var k = 0u; k < 4u; k++) {
            let channel = 4u * quad + k;
            if (channel < parameters.channels) {
                value[k] = plane[channel * parameters.cells + cell];
            }
        }
        packed[first + quad] = value;
    }
}
