// Converts the planes of a scale from [C, H · W] to the layout of `include/planes.wgsl`.
//
// Each invocation writes one cell with all its channels; missing channels of the last four become zero.

struct Parameters {
    // Cells of all planes, channels, vectors a cell.
    cells: u32,
    channels: u32,
    quads: u32,
    // Of each plane: where it begins, its cells, and its first cell in `packed`. One that does not exist has no cells.
    planes: array<vec4<u32>, 6>,
}

@group(0) @binding(0) var<storage, read_write> planes: array<f32>;
@group(0) @binding(1) var<storage, read_write> packed: array<vec4<f32>>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= parameters.cells) {
        return;
    }
    // The last plane that does not begin behind this cell.
    var plane = parameters.planes[0];
    for (var k = 1u; k < 6u; k++) {
        if (parameters.planes[k].y > 0u && parameters.planes[k].z <= own) {
            plane = parameters.planes[k];
        }
    }
    let cell = own - plane.z;
    let first = own * parameters.quads;
    for (var quad = 0u; quad < parameters.quads; quad++) {
        var value = vec4<f32>(0.0);
        for (var k = 0u; k < 4u; k++) {
            let channel = 4u * quad + k;
            if (channel < parameters.channels) {
                value[k] = planes[plane.x + channel * plane.y + cell];
            }
        }
        packed[first + quad] = value;
    }
}
