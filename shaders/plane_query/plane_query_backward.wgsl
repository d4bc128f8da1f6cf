// First half of the query's derivative: the gradients from every point to each of its samples, and the points' own
// gradients.
//
// Each invocation computes one point. It reads points, packed planes and `upstream` [N, C]. For plane p, at place p · N
// + n, it writes: the derivative with respect to the sample (QUADS vectors of `handed`), the low cell in which the
// sample begins (`cells`), and the fractions along width and height (`fractions`). It also writes the points' gradients
// [N, 4].

// #include planes

@group(0) @binding(0) var<storage, read_write> points: array<f32>;
@group(0) @binding(1) var<storage, read_write> packed: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> handed: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> cells: array<u32>;
@group(0) @binding(5) var<storage, read_write> fractions: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> point_gradients: array<f32>;
@group(0) @binding(7) var<uniform> planes: Planes;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = flat_group(group, groups) * WORKGROUP + lane;
    let count = planes.first_cells_b.w;
    if (n >= count) {
        return;
    }
    let point = vec4<f32>(points[4u * n], points[4u * n + 1u], points[4u * n + 2u], points[4u * n + 3u]);
    let axes = axis_samples(point, planes.resolution);
    for (var plane = 0u; plane < PLANES; plane++) {
        let along = plane_axes(plane);
        let low_row = first_cell(planes, plane) + axes.low[along.y] * planes.resolution[along.x];
        cells[plane * count + n] = low_row + axes.low[along.x];
        fractions[plane * count + n] = vec2<f32>(axes.fraction[along.x], axes.fraction[along.y]);
    }

    let channels = planes.sizes.x;
    let quads = planes.sizes.y;
    var d_point = vec4<f32>(0.0);
    for (var quad = 0u; quad < quads; quad++) {
        var above = vec4<f32>(0.0);
        for (var k = 0u; k < 4u; k++) {
            if (4u * quad + k < channels) {
                above[k] = upstream[n * channels + 4u * quad + k];
            }
        }
        var samples: array<vec4<f32>, PLANES>;
        var by_across: array<vec4<f32>, PLANES>;
        var by_down: array<vec4<f32>, PLANES>;
        for (var plane = 0u; plane < PLANES; plane++) {
            let along = plane_axes(plane);
            let width = planes.resolution[along.x];
            let first = first_cell(planes, plane);
            let row_low = first + axes.low[along.y] * width;
            let row_high = first + axes.high[along.y] * width;
            let x = axes.fraction[along.x];
            let y = axes.fraction[along.y];
            let c0 = packed[(row_low + axes.low[along.x]) * quads + quad];
            let c1 = packed[(row_low + axes.high[along.x]) * quads + quad];
            let c2 = packed[(row_high + axes.low[along.x]) * quads + quad];
            let c3 = packed[(row_high + axes.high[along.x]) * quads + quad];
            samples[plane] =
                c0 * ((1.0 - x) * (1.0 - y)) + c1 * (x * (1.0 - y)) + c2 * ((1.0 - x) * y) + c3 * (x * y);
            let lower = c1 - c0;
            by_across[plane] = lower + ((c3 - c2) - lower) * y;
            let first_column = c2 - c0;
            by_down[plane] = first_column + ((c3 - c1) - first_column) * x;
        }
        // The product of all other samples, without division: upstream · those before · those after.
        var before: array<vec4<f32>, PLANES>;
        before[0] = above;
        for (var plane = 1u; plane < PLANES; plane++) {
            before[plane] = before[plane - 1u] * samples[plane - 1u];
        }
        var after = vec4<f32>(1.0);
        for (var back = 0u; back < PLANES; back++) {
            let plane = PLANES - 1u - back;
            let gradient = before[plane] * after;
            after *= samples[plane];
            handed[(plane * count + n) * quads + quad] = gradient;
            let along = plane_axes(plane);
            let across = gradient * by_across[plane];
            let down = gradient * by_down[plane];
            d_point[along.x] += (across.x + across.y) + (across.z + across.w);
            d_point[along.y] += (down.x + down.y) + (down.z + down.w);
        }
    }
    d_point *= axes.slope;
    for (var axis = 0u; axis < 4u; axis++) {
        point_gradients[4u * n + axis] = d_point[axis];
    }
}
