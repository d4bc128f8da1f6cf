// One Gaussian on the screen: four vectors in `splats`, at 4 * Gaussian.
//
//   0: x, y, depth, opacity
//   1: inverse of the 2D covariance xx, xy, yy; reach
//   2: red, green, blue (not below 0); flags of clamped channels, see `project.wgsl`
//   3: 2D covariance xx, yy; radius in pixels; number of cells that it touches
//
// The reach is twice the exponent at which alpha falls below 1/255; negative if it never gets there.

struct Splat {
    position: vec2<f32>,
    depth: f32,
    opacity: f32,
    conic: vec3<f32>,
    reach: f32,
    variance: vec2<f32>,
    radius: f32,
}

// Half-open ranges, first columns, then rows.
struct Rectangle {
    low: vec2<u32>,
    high: vec2<u32>,
}

// Tiles of the 3-sigma box, truncated as in the original rasterizer.
fn tile_rectangle(position: vec2<f32>, radius: f32) -> Rectangle {
    let tile = f32(TILE);
    let reach = vec2<f32>(min(radius, 2147483648.0));
    let tiles = vec2<f32>(view.size.zw);
    let zero = vec2<f32>(0.0);
    let low = clamp(trunc((position - reach) / tile), zero, tiles);
    let high = clamp(trunc((position + reach + tile - 1.0) / tile), zero, tiles);
    return Rectangle(vec2<u32>(low), vec2<u32>(high));
}

// Cells of those tiles that may hold a pixel which the splat reaches: its bounding box.
fn cell_rectangle(splat: Splat) -> Rectangle {
    let tiles = tile_rectangle(splat.position, splat.radius);
    let factor = TILE / CELL;
    let half = sqrt(splat.reach * 1.001 * splat.variance) * 1.001 + 0.05;
    let cell = f32(CELL);
    let cells = vec2<f32>(view.cells.xy);
    let zero = vec2<f32>(0.0);
    let low = clamp(floor((splat.position - half) / cell), zero, cells);
    let high = clamp(floor((splat.position + half) / cell) + 1.0, zero, cells);
    return Rectangle(max(tiles.low * factor, vec2<u32>(low)), min(min(tiles.high * factor, view.cells.xy), vec2<u32>(high)));
}

fn quadratic_form(conic: vec3<f32>, x: f32, y: f32) -> f32 {
    return conic.x * x * x + 2.0 * conic.y * x * y + conic.z * y * y;
}

// Whether the splat's alpha reaches the threshold anywhere in the cell: the smallest exponent over the pixels' bounding
// rectangle, found on its edges unless the center is inside.
fn reaches(splat: Splat, column: u32, row: u32) -> bool {
    let low = vec2<f32>(vec2<u32>(column, row) * CELL) - splat.position;
    let high = low + f32(CELL - 1u);
    if (all(low <= vec2<f32>(0.0)) && all(high >= vec2<f32>(0.0))) {
        return true;
    }
    let slope_y = -splat.conic.y / splat.conic.z;
    let slope_x = -splat.conic.y / splat.conic.x;
    let on_columns = min(
        quadratic_form(splat.conic, low.x, clamp(slope_y * low.x, low.y, high.y)),
        quadratic_form(splat.conic, high.x, clamp(slope_y * high.x, low.y, high.y)),
    );
    let on_rows = min(
        quadratic_form(splat.conic, clamp(slope_x * low.y, low.x, high.x), low.y),
        quadratic_form(splat.conic, clamp(slope_x * high.y, low.x, high.x), high.y),
    );
    // A small margin, since the pixels evaluate the form with other rounding. The error of the builtin logarithm is
    // within it.
    return min(on_columns, on_rows) <= splat.reach * 1.002 + 4e-3;
}
