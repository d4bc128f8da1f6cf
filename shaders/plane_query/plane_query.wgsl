// Features at points: the product over the planes of a scale of their bilinear samples.
//
// Each invocation computes one vector of four channels for one point. It reads points [N, 4] in [-1, 1] and the packed
// planes, and writes features [N, C].

// #include planes

@group(0) @binding(0) var<storage, read_write> points: array<f32>;
@group(0) @binding(1) var<storage, read_write> packed: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> features: array<f32>;
@group(0) @binding(3) var<uniform> planes: Planes;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    let quads = planes.sizes.y;
    let n = own / quads;
    if (n >= planes.first_cells_b.w) {
        return;
    }
    let quad = own % quads;
    let point = vec4<f32>(points[4u * n], points[4u * n + 1u], points[4u * n + 2u], points[4u * n + 3u]);
    let axes = axis_samples(point, planes.resolution);
    var product = vec4<f32>(1.0);
    for (var plane = 0u; plane < PLANES; plane++) {
        let along = plane_axes(plane);
        let width = planes.resolution[along.x];
        let first = first_cell(planes, plane);
        let row_low = first + axes.low[along.y] * width;
        let row_high = first + axes.high[along.y] * width;
        let x = axes.fraction[along.x];
        let y = axes.fraction[along.y];
        product *= packed[(row_low + axes.low[along.x]) * quads + quad] * ((1.0 - x) * (1.0 - y))
            + packed[(row_low + axes.high[along.x]) * quads + quad] * (x * (1.0 - y))
            + packed[(row_high + axes.low[along.x]) * quads + quad] * ((1.0 - x) * y)
            + packed[(row_high + axes.high[along.x]) * quads + quad] * (x * y);
    }
    let channels = planes.sizes.x;
    for (var k = 0u; k < 4u; k++) {
        let channel = 4u * quad + k;
        if (channel < channels) {
            features[n * channels + channel] = product[k];
        }
    }
}
