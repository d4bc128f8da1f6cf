// Lists the intersections, the pairs of a cell and a Gaussian that touches it, nearest Gaussian first.
//
// Each invocation computes one Gaussian, at a position in the order of depths. It writes the cell and the Gaussian of
// each of its intersections, one after the other from the position's entry of `first_places`. The number of its first
// intersection is kept in `first_of_gaussian`, so that the backward pass finds all of them. Intersections for which there is
// no room are left out. Room that is left gets the cell behind the last one, which sorts to the end of all lists.

// #include arithmetic, view, splat

@group(0) @binding(0) var<storage, read_write> by_depth: array<u32>;
@group(0) @binding(1) var<storage, read_write> first_places: array<u32>;
@group(0) @binding(2) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> first_of_gaussian: array<u32>;
@group(0) @binding(4) var<storage, read_write> cells: array<u32>;
@group(0) @binding(5) var<storage, read_write> gaussians: array<u32>;
@group(0) @binding(6) var<storage, read_write> total: array<u32>;
@group(0) @binding(7) var<uniform> view: View;

fn write_intersection(place: u32, cell: u32, gaussian: u32) {
    if (place < view.counts.w) {
        cells[place] = cell;
        gaussians[place] = gaussian;
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = flat_group(group, groups) * WORKGROUP + lane;
    if (place >= view.counts.x) {
        return;
    }
    let no_cell = view.cells.x * view.cells.y;
    for (var free = total[0] + place; free < view.counts.w; free += view.counts.x) {
        write_intersection(free, no_cell, 0u);
    }
    let i = by_depth[place];
    var next = first_places[place];
    first_of_gaussian[i] = next;
    let shape = splats[4u * i + 3u];
    let end = next + u32(shape.w);
    if (next == end) {
        return;
    }
    let center = splats[4u * i];
    let conic = splats[4u * i + 1u];
    var splat: Splat;
    splat.position = center.xy;
    splat.conic = conic.xyz;
    splat.reach = conic.w;
    splat.variance = shape.xy;
    splat.radius = shape.z;
    let rectangle = cell_rectangle(splat);
    var column = rectangle.low.x;
    var row = rectangle.low.y;
    while (row < rectangle.high.y && next < end) {
        if (reaches(splat, column, row)) {
            write_intersection(next, row * view.cells.x + column, i);
            next += 1u;
        }
        column += 1u;
        if (column == rectangle.high.x) {
            column = rectangle.low.x;
            row += 1u;
        }
    }
    if (next == end) {
        return;
    }
    // If the compiler makes this round differently from `project.wgsl`, a place may remain unused: no cell has it, and
    // no sums are written for it. So the splat gets the real number of its cells.
    splats[4u * i + 3u].w = f32(next - first_places[place]);
    while (next < end) {
        write_intersection(next, no_cell, i);
        next += 1u;
    }
}
