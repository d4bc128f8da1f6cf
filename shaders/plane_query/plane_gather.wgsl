// Second half of the query's derivative: every cell adds up the gradients from the samples around it.
//
// Each invocation computes four channels of one cell of one plane. A sample contributes to its low cell and to
// the next ones along width and height, so a cell reads the samples that begin in it and in three neighbors. Samples
// are sorted by low cell (`order`, with ranges in `starts`), and within a cell by point. So the four cells are two
// ranges, every sum has one order, and no atomics are needed. Writes the planes' gradients, each [C, H · W], at the
// places in `places`. A launch takes a bounded number of samples of a cell, so that no loop gets too long; later
// launches add the rest.

// #include planes

struct Places {
    // Where the gradients of the first four planes begin.
    a: vec4<u32>,
    // Those of two more; the first sample of every cell that this launch takes, and their number.
    b: vec4<u32>,
}

struct Parameters {
    planes: Planes,
    places: Places,
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
    let index = flat_group(group, groups) * WORKGROUP + lane;
    let own = index / planes.sizes.y;
    let quad = index % planes.sizes.y;
    if (own >= planes.first_cells_b.z) {
        return;
    }
    var plane = 0u;
    for (var k = 1u; k < PLANES; k++) {
        plane += select(0u, 1u, own >= first_cell(planes, k));
    }
    let width = planes.resolution[plane_axes(plane).x];
    let cell = own - first_cell(planes, plane);
    let row = cell / width;
    let at_left = cell - row * width == 0u;

    // Positions in `order`: the beginning of the left neighbor's samples, that of the own column's, and the end; first
    // for those that begin in the row above, then for those of the own row.
    var above = vec3<u32>(0u);
    if (row > 0u) {
        let up = own - width;
        above = vec3<u32>(starts[select(up - 1u, up, at_left)], starts[up], starts[up + 1u]);
    }
    let level = vec3<u32>(starts[select(own - 1u, own, at_left)], starts[own], starts[own + 1u]);
    let count_above = above.z - above.x;
    let begin = parameters.places.b.z;
    let end = min(begin + parameters.places.b.w, count_above + level.z - level.x);
    if (begin > 0u && begin >= end) {
        return;
    }

    let cells = select(planes.first_cells_b.z, first_cell(planes, min(plane + 1u, 5u)), plane + 1u < PLANES)
        - first_cell(planes, plane);
    var first = parameters.places.a[plane % 4u];
    if (plane >= 4u) {
        first = parameters.places.b[plane - 4u];
    }
    var sum = vec4<f32>(0.0);
    for (var next = begin; next < end; next++) {
        let is_above = next < count_above;
        let place = select(level.x + next - count_above, above.x + next, is_above);
        let is_left = place < select(level.y, above.y, is_above);
        let sample = order[place];
        let fraction = fractions[sample];
        let weight = select(1.0 - fraction, fraction, vec2<bool>(is_left, is_above));
        sum += weight.x * weight.y * handed[sample * planes.sizes.y + quad];
    }
    for (var k = 0u; k < 4u; k++) {
        let channel = 4u * quad + k;
        let at = first + channel * cells + cell;
        if (channel < planes.sizes.x) {
            if (begin > 0u) {
                sum[k] += gradients[at];
            }
            gradients[at] = sum[k];
        }
    }
}
