//! The splats of each tile, sorted front to back.

use light4gs_codec::rendering::TILE;
use rayon::prelude::*;

use super::project::{GaussianSlices, Splat, project};
use crate::view::View;

/// Gaussians that a parallel task projects. The number is fixed, so that results do not depend on the number of
/// threads.
const CHUNK: usize = 512;

/// Projected Gaussians and their tiles.
///
/// An *intersection* is a (tile, Gaussian) pair. Intersections are numbered twice: by Gaussian (all tiles of Gaussian
/// 0, then those of Gaussian 1, ...) and by tile (all of tile 0 front to back, then those of tile 1, ...).
#[derive(Debug)]
pub struct TileLists {
    /// `[N]`
    pub(crate) splats: Vec<Splat>,
    /// `[N + 1]`: where the intersections of each Gaussian begin, numbered by Gaussian.
    pub(crate) gaussian_starts: Vec<u32>,
    /// `[tiles + 1]`: where the intersections of each tile begin, numbered by tile.
    pub(crate) tile_starts: Vec<u32>,
    /// Numbered by tile: the Gaussian of each intersection.
    pub(crate) gaussians: Vec<u32>,
    /// Numbered by Gaussian: the number by tile of each intersection.
    pub(crate) tile_order: Vec<u32>,
}

/// Whether the splat's alpha reaches the threshold anywhere in the tile. The smallest exponent over the rectangle of
/// the tile's pixels decides; it is on an edge, unless the center is inside.
fn reaches(splat: &Splat, column: usize, row: usize) -> bool {
    let (x0, y0) = ((column * TILE) as f32 - splat.x, (row * TILE) as f32 - splat.y);
    let (x1, y1) = (x0 + (TILE - 1) as f32, y0 + (TILE - 1) as f32);
    if x0 <= 0.0 && x1 >= 0.0 && y0 <= 0.0 && y1 >= 0.0 {
        return true;
    }
    let [a, b, c] = splat.conic;
    let form = |x: f32, y: f32| a * x * x + 2.0 * b * x * y + c * y * y;
    let on_column = |x: f32| form(x, (-b * x / c).clamp(y0, y1));
    let on_row = |y: f32| form((-b * y / a).clamp(x0, x1), y);
    let smallest = on_column(x0).min(on_column(x1)).min(on_row(y0)).min(on_row(y1));
    // A small margin, since the pixels evaluate the form with other rounding.
    smallest <= splat.reach * 1.001 + 1e-3
}

impl TileLists {
    /// Projects all Gaussians and lists their tiles.
    pub fn build(gaussians: &GaussianSlices, view: &View) -> Self {
        let count = gaussians.len();
        let chunks: Vec<(Vec<Splat>, Vec<u32>, Vec<u32>)> = (0..count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(count);
                let mut splats = Vec::with_capacity(range.len());
                let mut counts = Vec::with_capacity(range.len());
                let mut tiles = Vec::with_capacity(4 * range.len());
                for i in range {
                    let splat = project(gaussians, i, view);
                    let before = tiles.len();
                    list_tiles(&splat, view, &mut tiles);
                    counts.push((tiles.len() - before) as u32);
                    splats.push(splat);
                }
                (splats, counts, tiles)
            })
            .collect();

        let mut splats = Vec::with_capacity(count);
        let mut gaussian_starts = Vec::with_capacity(count + 1);
        let mut tiles = Vec::with_capacity(chunks.iter().map(|c| c.2.len()).sum());
        gaussian_starts.push(0);
        let mut start = 0;
        for (chunk_splats, counts, chunk_tiles) in chunks {
            splats.extend_from_slice(&chunk_splats);
            tiles.extend_from_slice(&chunk_tiles);
            for n in counts {
                start += n;
                gaussian_starts.push(start);
            }
        }

        let mut by_depth: Vec<u64> = (0..count)
            .filter(|&i| gaussian_starts[i] < gaussian_starts[i + 1])
            // Depths are positive, so their bits have the same order; of equal depths, the lower index comes first.
            .map(|i| u64::from(splats[i].depth.to_bits()) << 32 | i as u64)
            .collect();
        by_depth.par_sort_unstable();

        let tile_count = view.tiles_across() * view.tiles_down();
        let mut tile_starts = vec![0u32; tile_count + 1];
        for &tile in &tiles {
            tile_starts[tile as usize + 1] += 1;
        }
        for t in 0..tile_count {
            tile_starts[t + 1] += tile_starts[t];
        }
        let mut next = tile_starts.clone();
        let mut listed = vec![0u32; tiles.len()];
        let mut tile_order = vec![0u32; tiles.len()];
        for key in by_depth {
            let i = key as u32;
            for k in gaussian_starts[i as usize]..gaussian_starts[i as usize + 1] {
                let place = &mut next[tiles[k as usize] as usize];
                listed[*place as usize] = i;
                tile_order[k as usize] = *place;
                *place += 1;
            }
        }
        Self { splats, gaussian_starts, tile_starts, gaussians: listed, tile_order }
    }

    /// Memory that [`TileLists::build`] takes for each Gaussian, bytes: the splat twice, a count, two starts, a key of the
    /// sort.
    pub const BYTES_OF_A_GAUSSIAN: u64 = 2 * size_of::<Splat>() as u64 + 4 * 3 + 8;

    /// An upper bound of the number of intersections that [`TileLists::build`] lists, so that a program can refuse them
    /// before they take memory.
    pub fn most_pairs(gaussians: &GaussianSlices, view: &View) -> u64 {
        let chunk = |chunk: usize| {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(gaussians.len());
            range.map(|i| most_tiles(&project(gaussians, i, view), view)).sum::<u64>()
        };
        (0..gaussians.len().div_ceil(CHUNK)).into_par_iter().map(chunk).sum()
    }

    /// `[N]`, radii in pixels: three standard deviations, rounded up; 0 outside the image, and
    /// [`INVALID_RADIUS`](crate::INVALID_RADIUS) for a Gaussian that cannot be drawn.
    pub fn radii(&self) -> Vec<i32> {
        self.splats.iter().map(|splat| splat.radius).collect()
    }

    /// Number of all intersections.
    pub fn intersections(&self) -> usize {
        self.gaussians.len()
    }

    /// Range of a tile's intersections, numbered by tile.
    pub(crate) fn tile_range(&self, tile: usize) -> std::ops::Range<usize> {
        self.tile_starts[tile] as usize..self.tile_starts[tile + 1] as usize
    }

    /// Splits values that are numbered by tile, one for each intersection, into one slice for each tile.
    pub(crate) fn split_by_tile<'a, T>(&self, mut values: &'a mut [T]) -> Vec<&'a mut [T]> {
        let tiles = self.tile_starts.len() - 1;
        let mut by_tile = Vec::with_capacity(tiles);
        for tile in 0..tiles {
            let (own, others) = values.split_at_mut(self.tile_range(tile).len());
            by_tile.push(own);
            values = others;
        }
        by_tile
    }

    /// Sum of a Gaussian's values over its tiles, in a fixed order. There is one value for each intersection, numbered
    /// by tile. `None` if the Gaussian is in no tile.
    pub(crate) fn sum_of<const K: usize>(&self, i: usize, values: &[[f32; K]]) -> Option<[f32; K]> {
        let intersections = self.gaussian_range(i);
        if intersections.is_empty() {
            return None;
        }
        let mut total = [0.0; K];
        for &place in &self.tile_order[intersections] {
            for (t, v) in total.iter_mut().zip(&values[place as usize]) {
                *t += v;
            }
        }
        Some(total)
    }

    /// Range of a Gaussian's intersections, numbered by Gaussian.
    fn gaussian_range(&self, i: usize) -> std::ops::Range<usize> {
        self.gaussian_starts[i] as usize..self.gaussian_starts[i + 1] as usize
    }
}

/// Whether the splat is drawn at all.
fn is_drawn(splat: &Splat) -> bool {
    splat.radius > 0 && splat.reach >= 0.0
}

/// Tiles of the rectangle around a splat.
fn most_tiles(splat: &Splat, view: &View) -> u64 {
    if !is_drawn(splat) {
        return 0;
    }
    let rectangle = splat.tile_rectangle(view);
    let [columns, rows] = [rectangle.columns, rectangle.rows].map(|[low, high]| high.saturating_sub(low) as u64);
    columns * rows
}

fn list_tiles(splat: &Splat, view: &View, tiles: &mut Vec<u32>) {
    if !is_drawn(splat) {
        return;
    }
    let rectangle = splat.tile_rectangle(view);
    for row in rectangle.rows[0]..rectangle.rows[1] {
        for column in rectangle.columns[0]..rectangle.columns[1] {
            if reaches(splat, column, row) {
                tiles.push((row * view.tiles_across() + column) as u32);
            }
        }
    }
}
