//! Alpha blending of sorted splats, one task for each tile: `color += T · alpha · color_i, depth += T · alpha · z_i`.

use light4gs_codec::rendering::TILE;
use rayon::prelude::*;

use super::blend::{Contribution, GROUPS, Hits, TilePlane, TileVisitor, WIDTH, group_and_lanes, walk};
use super::project::Splat;
use super::tiles::TileLists;
use crate::lanes::{LANES, LaneKernel, Lanes, dispatch};
use crate::view::View;

/// Values of a pixel of the output: red, green, blue, alpha, depth.
pub const CHANNELS: usize = 5;

const EMPTY: TilePlane = [[0.0; LANES]; GROUPS];

/// The sums at a tile's pixels after all its splats; [`assemble`] makes an image of them.
#[derive(Clone, Debug)]
pub struct TilePixels {
    pub(crate) color: [TilePlane; 3],
    pub(crate) depth: TilePlane,
    pub(crate) transmittance: TilePlane,
    /// For each of the tile's splats from the front, the groups of pixels that it hits.
    pub(crate) hits: Vec<u32>,
}

impl<L: Lanes> TileVisitor<L> for TilePixels {
    /// Color and depth.
    type Splat = [L; 4];

    #[inline(always)]
    fn begin(&self, _: usize, splat: &Splat) -> [L; 4] {
        let [red, green, blue] = splat.color;
        // Written out: with a call that is not inlined, values leave the vector registers.
        [L::splat(red), L::splat(green), L::splat(blue), L::splat(splat.depth)]
    }

    #[inline(always)]
    fn visit(&mut self, values: &mut [L; 4], contribution: &Contribution<L>) {
        let Contribution { group, weight, .. } = *contribution;
        for c in 0..3 {
            let plane = &mut self.color[c][group];
            weight.mul_add(values[c], L::load(plane)).store(plane);
        }
        let plane = &mut self.depth[group];
        weight.mul_add(values[3], L::load(plane)).store(plane);
    }

    #[inline(always)]
    fn end(&mut self, _: usize, _: [L; 4]) {}
}

struct RasterizeTile<'a> {
    lists: &'a TileLists,
    view: &'a View,
    tile: usize,
}

impl LaneKernel for RasterizeTile<'_> {
    type Output = TilePixels;

    #[inline(always)]
    fn run<L: Lanes>(self) -> TilePixels {
        let mut hits = Vec::with_capacity(self.lists.tile_range(self.tile).len());
        let mut pixels = TilePixels { color: [EMPTY; 3], depth: EMPTY, transmittance: EMPTY, hits: Vec::new() };
        pixels.transmittance = walk::<L, _>(self.lists, self.view, self.tile, &mut pixels, Hits::Found(&mut hits));
        pixels.hits = hits;
        pixels
    }
}

/// Blends the pixels of every tile. The result has one entry for each tile, row by row.
pub fn rasterize(lists: &TileLists, view: &View) -> Vec<TilePixels> {
    (0..view.tiles_across() * view.tiles_down())
        .into_par_iter()
        .map(|tile| dispatch(RasterizeTile { lists, view, tile }))
        .collect()
}

/// Assembles the tiles to `5 H W` numbers: color over the background `[H, W, 3]`, then alpha `[H, W]`, then depth `[H,
/// W]` (world units along the view axis, `sum(T · alpha · z)`).
///
/// It is one flat array with contiguous parts, since an operation on the tape has one output and contiguous slices are
/// cheap.
pub fn assemble(tiles: &[TilePixels], view: &View) -> Vec<f32> {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let mut rendering = vec![0.0; width * height * CHANNELS];
    let (image, rest) = rendering.split_at_mut(3 * width * height);
    let (alpha, depth) = rest.split_at_mut(width * height);
    image
        .par_chunks_mut(3 * width)
        .zip(alpha.par_chunks_mut(width))
        .zip(depth.par_chunks_mut(width))
        .enumerate()
        .for_each(|(y, ((image, alpha), depth))| {
            let pixels = image.chunks_mut(3 * WIDTH).zip(alpha.chunks_mut(WIDTH)).zip(depth.chunks_mut(WIDTH));
            for (run, ((image, alpha), depth)) in pixels.enumerate() {
                let x = run * WIDTH;
                let tile = &tiles[y / TILE * view.tiles_across() + x / TILE];
                let (group, lanes) = group_and_lanes(x % TILE, y % TILE);
                let [red, green, blue] = tile.color.each_ref().map(|plane| &plane[group][lanes.clone()]);
                let transmittance = &tile.transmittance[group][lanes.clone()];
                for (k, pixel) in image.chunks_mut(3).enumerate() {
                    for (channel, color) in [red, green, blue].into_iter().enumerate() {
                        pixel[channel] = color[k] + transmittance[k] * view.background[channel];
                    }
                }
                alpha.iter_mut().zip(transmittance).for_each(|(alpha, t)| *alpha = 1.0 - t);
                depth.iter_mut().zip(&tile.depth[group][lanes]).for_each(|(to, from)| *to = *from);
            }
        });
    rendering
}

/// Reads a tile of the output of [`assemble`] into planes; pixels outside the image are zero.
pub(crate) fn tile_of(rendering: &[f32], view: &View, column: usize, row: usize) -> [TilePlane; CHANNELS] {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let (image, rest) = rendering.split_at(3 * width * height);
    let (alpha, depth) = rest.split_at(width * height);
    let mut planes = [EMPTY; CHANNELS];
    for y in row * TILE..((row + 1) * TILE).min(height) {
        let end = ((column + 1) * TILE).min(width);
        for x in (column * TILE..end).step_by(WIDTH) {
            let (group, lanes) = group_and_lanes(x % TILE, y % TILE);
            let pixels = y * width + x..y * width + (x + WIDTH).min(end);
            let lanes = lanes.start..lanes.start + pixels.len();
            for (k, pixel) in image[3 * pixels.start..3 * pixels.end].chunks_exact(3).enumerate() {
                for (channel, value) in pixel.iter().enumerate() {
                    planes[channel][group][lanes.start + k] = *value;
                }
            }
            planes[3][group][lanes.clone()].copy_from_slice(&alpha[pixels.clone()]);
            planes[4][group][lanes].copy_from_slice(&depth[pixels]);
        }
    }
    planes
}
