// Bilinear samples of the planes of a scale: PLANES of those over xy, xz, xt, yz, yt, zt, in this order. AXIS_PAIRS has
// the index of each in that list, three bits for each plane from the lowest on.
//
// The planes are one after the other in `packed`, cell by cell; a cell's channels are in QUADS vectors of four.
// `first_cell` gives the beginning of each plane; the last entry is the end.

struct Planes {
    // Cells along x, y, z, t; 1 along an axis that no plane spans.
    resolution: vec4<u32>,
    // First cells of six planes (the end for those that do not exist), and the end; then the number of points.
    first_cells_a: vec4<u32>,
    first_cells_b: vec4<u32>,
    // Channels, vectors of four channels for each cell, then unused.
    sizes: vec4<u32>,
}

// The axes of the planes: along the width, along the height.
fn plane_axes(plane: u32) -> vec2<u32> {
    switch (AXIS_PAIRS >> (3u * plane)) & 7u {
        case 0u: { return vec2<u32>(0u, 1u); }
        case 1u: { return vec2<u32>(0u, 2u); }
        case 2u: { return vec2<u32>(0u, 3u); }
        case 3u: { return vec2<u32>(1u, 2u); }
        case 4u: { return vec2<u32>(1u, 3u); }
        default: { return vec2<u32>(2u, 3u); }
    }
}

fn first_cell(planes: Planes, plane: u32) -> u32 {
    if (plane < 4u) {
        return planes.first_cells_a[plane];
    }
    return planes.first_cells_b[plane - 4u];
}

// The position of a point on each axis. Align-corners: -1 is the first cell's center, 1 the last one's; clamped to the
// border.
struct AxisSamples {
    low: vec4<u32>,
    high: vec4<u32>,
    fraction: vec4<f32>,
    // Cells for each unit of the coordinate; 0 where it is clamped to the border.
    slope: vec4<f32>,
}

fn axis_samples(point: vec4<f32>, resolution: vec4<u32>) -> AxisSamples {
    let last = vec4<f32>(resolution - 1u);
    let position = (point + 1.0) * 0.5 * last;
    let inside = (position > vec4<f32>(0.0)) & (position < last);
    // NaN becomes 0, so that it can be an index.
    let is_number = (bitcast<vec4<u32>>(position) & vec4<u32>(0x7fffffffu)) <= vec4<u32>(0x7f800000u);
    let clamped = select(vec4<f32>(0.0), clamp(position, vec4<f32>(0.0), last), is_number);
    let low = min(vec4<u32>(clamped), max(resolution, vec4<u32>(2u)) - 2u);
    return AxisSamples(
        low,
        min(low + 1u, resolution - 1u),
        clamped - vec4<f32>(low),
        select(vec4<f32>(0.0), 0.5 * last, inside),
    );
}
