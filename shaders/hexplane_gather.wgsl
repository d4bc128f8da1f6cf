// Second half of the query's derivative: every cell gathers what the samples around it hand over.
//
// One invocation owns one vector of four channels of one cell of one plane. A sample reaches its low cell and the next
// ones along width and height, so a cell looks at the samples that begin in it and in three neighbours. Samples come sorted
// by low cell (`order`, ranges in `starts`), and equal ones in the order of points: every sum has one order, and no
// atomics. Writes the planes' gradients, each [C, H · W], from the places in `parts`.

struct Parts {
    a: vec4<u32>,
    b: vec4<u32>,
}

struct Parameters {
    planes: Planes,
    parts: Parts,
}

@group(0) @binding(0) var<storage, read_write> starts: array<u32>;
@group(0) @binding(1) var<storage, read_write> order: array<u32>;
@group(0) @binding(2) var<storage, read_write> fractions: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(5) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let planes = parameters.planes;
    let own = flat_group(group, groups) * WORKGROUP + lane;
    let quads = planes.sizes.y;
    let global = own / quads;
    if (global >= planes.first_cells_b.z) {
        return;
    }
    let quad = own % quads;
    var plane = 0u;
    for (var k = 1u; k < 6u; k++) {
        plane += select(0u, 1u, global >= first_cell(planes, k));
    }
    let along = plane_axes(plane);
    let width = planes.resolution[along.x];
    let cell = global - first_cell(planes, plane);
    let column = cell % width;
    let row = cell / width;

    var sum = vec4<f32>(0.0);
    for (var corner = 0u; corner < 4u; corner++) {
        let back = vec2<u32>(corner & 1u, corner >> 1u);
        if (column >= back.x && row >= back.y) {
            let low = global - back.y * width - back.x;
            for (var place = starts[low]; place < starts[low + 1u]; place++) {
                let sample = order[place];
                let fraction = fractions[sample];
                let weight = select(1.0 - fraction, fraction, back == vec2<u32>(1u));
                sum += weight.x * weight.y * handed[sample * quads + quad];
            }
        }
    }
    let cells = select(planes.first_cells_b.z, first_cell(planes, min(plane + 1u, 5u)), plane < 5u)
        - first_cell(planes, plane);
    var first = parameters.parts.a[plane % 4u];
    if (plane >= 4u) {
        first = parameters.parts.b[plane - 4u];
    }
    for (var k = 0u; k < 4u; k++) {
        let channel = 4u * quad + k;
        if (channel < planes.sizes.x) {
            gradients[first + channel * cells + cell] = sum[k];
        }
    }
}
