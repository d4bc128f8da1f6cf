// The pixels of one invocation of a team: one column of the cell, every ROW_STEP-th row, four rows in a vector.

const PIXELS: u32 = CELL * CELL / TEAM;
const QUADS: u32 = PIXELS / 4u;
const ROW_STEP: u32 = TEAM / CELL;

struct OwnPixels {
    x: u32,
    first_y: u32,
}

fn own_pixels(cell: u32, lane: u32) -> OwnPixels {
    let column = cell % view.cells.x;
    let row = cell / view.cells.x;
    return OwnPixels(column * CELL + lane % CELL, row * CELL + lane / CELL);
}

fn pixel_y(own: OwnPixels, k: u32) -> u32 {
    return own.first_y + k * ROW_STEP;
}

fn in_image(own: OwnPixels, k: u32) -> bool {
    return own.x < view.size.x && pixel_y(own, k) < view.size.y;
}

fn pixel_index(own: OwnPixels, k: u32) -> u32 {
    return pixel_y(own, k) * view.size.x + own.x;
}

// Rows of four pixels.
fn quad_rows(own: OwnPixels, quad: u32) -> vec4<f32> {
    return f32(own.first_y) + f32(ROW_STEP) * (vec4<f32>(0.0, 1.0, 2.0, 3.0) + f32(4u * quad));
}

// The chunk of the cell's list that this launch blends.
fn chunk_of(start: u32, end: u32) -> vec2<u32> {
    let first = min(start + view.cells.z * view.pixels.z, end);
    return vec2<u32>(first, min(first + view.pixels.z, end));
}
