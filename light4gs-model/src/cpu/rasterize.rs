//! Alpha blending of sorted splats, one task a tile, eight pixels of a row at a time.
//!
//! Within a tile only the rows and the eight-pixel groups that the splat's alpha can reach are visited, so the cost
//! follows the covered pixels. Per pixel, front to back:
//!
//! ```text
//! alpha = min(0.99, opacity · exp(-q)),  skipped below 1/255
//! stop before the splat that would take the transmittance T below 1e-4
//! color += T · alpha · color_i,  depth += T · alpha · z_i,  T *= 1 - alpha
//! ```

use std::ops::RangeInclusive;

use rayon::prelude::*;

use super::lanes::{LANES, LaneKernel, Lanes, dispatch};
use super::project::{MIN_ALPHA, Splat, TILE, View};
use super::tiles::TileLists;

pub(crate) const MAX_ALPHA: f32 = 0.99;
/// A pixel takes no splat that would leave it with less transmittance.
pub(crate) const MIN_TRANSMITTANCE: f32 = 1e-4;
/// Values a pixel of the output: red, green, blue, alpha, depth.
pub(crate) const CHANNELS: usize = 5;

const GROUPS: usize = TILE / LANES;
/// Splats between two looks at whether the whole tile is opaque.
const OPAQUE_CHECK: usize = 32;

/// One value for every pixel of a tile, in rows of eight-pixel groups.
pub(crate) type TilePlane = [[f32; LANES]; TILE * GROUPS];

const EMPTY: TilePlane = [[0.0; LANES]; TILE * GROUPS];

/// Sums over a tile's pixels after all its splats.
#[derive(Clone, Debug)]
pub(crate) struct TilePixels {
    pub(crate) color: [TilePlane; 3],
    pub(crate) depth: TilePlane,
    pub(crate) transmittance: TilePlane,
}

/// What the evaluation of one splat at eight pixels gives.
pub(crate) struct Footprint<L> {
    /// Pixel offsets from the centre of the splat to the pixels, horizontally.
    pub(crate) dx: L,
    /// After the clamp at [`MAX_ALPHA`].
    pub(crate) alpha: L,
    /// Mask: the alpha was not clamped, so it still depends on the splat.
    pub(crate) free: L,
    /// Mask: the splat is not skipped for smallness.
    pub(crate) hit: L,
}

/// A splat with its values spread over the lanes.
#[derive(Clone, Copy)]
pub(crate) struct WideSplat<L> {
    x: L,
    half_a: L,
    b: L,
    half_c: L,
    opacity: L,
    pub(crate) color: [L; 3],
    pub(crate) depth: L,
}

impl<L: Lanes> WideSplat<L> {
    #[inline(always)]
    pub(crate) fn new(splat: &Splat) -> Self {
        Self {
            x: L::splat(splat.x),
            half_a: L::splat(-0.5 * splat.conic[0]),
            b: L::splat(-splat.conic[1]),
            half_c: L::splat(-0.5 * splat.conic[2]),
            opacity: L::splat(splat.opacity),
            // Written out: a call that is not inlined leaves the vector registers.
            color: [L::splat(splat.color[0]), L::splat(splat.color[1]), L::splat(splat.color[2])],
            depth: L::splat(splat.depth),
        }
    }

    #[inline(always)]
    pub(crate) fn footprint(&self, pixels_x: L, dy: L) -> Footprint<L> {
        let dx = self.x.sub(pixels_x);
        let power = self.half_c.mul(dy).mul_add(dy, self.half_a.mul(dx).mul_add(dx, self.b.mul(dx).mul(dy)));
        let raw = self.opacity.mul(power.exp());
        let free = L::splat(MAX_ALPHA).at_least(raw);
        let alpha = raw.min(L::splat(MAX_ALPHA));
        let hit = alpha.at_least(L::splat(MIN_ALPHA)).and(L::splat(0.0).at_least(power));
        Footprint { dx, alpha, free, hit }
    }
}

/// Rows of the tile that the splat can reach.
#[inline(always)]
pub(crate) fn rows(splat: &Splat, origin_y: f32) -> std::ops::Range<usize> {
    let half = (splat.reach * splat.variance[1]).sqrt() * 1.001 + 1e-2;
    let low = (splat.y - half - origin_y).ceil().max(0.0) as usize;
    let high = (splat.y + half - origin_y).floor();
    low..if high < 0.0 { 0 } else { (high as usize + 1).min(TILE) }
}

/// Eight-pixel groups of a row that the splat can reach; empty if none.
#[inline(always)]
pub(crate) fn groups(splat: &Splat, origin_x: f32, dy: f32) -> RangeInclusive<usize> {
    #[expect(clippy::reversed_empty_ranges)]
    const NONE: RangeInclusive<usize> = 1..=0;
    let [a, b, _] = splat.conic;
    let left = splat.reach * 1.002 + 1e-2 - dy * dy / splat.variance[1];
    if left < 0.0 {
        return NONE;
    }
    let half = (left / a).sqrt() * 1.001 + 0.05;
    // With dx = x - pixel the form is least at dx = -b dy / a.
    let center = splat.x + b * dy / a - origin_x;
    let (low, high) = (center - half, center + half);
    if high < 0.0 || low > (TILE - 1) as f32 {
        return NONE;
    }
    let low = low.max(0.0) as usize / LANES;
    let high = (high as usize).min(TILE - 1) / LANES;
    low..=high
}

/// Pixel columns of a group as lanes, from the tile's left edge.
#[inline(always)]
pub(crate) fn pixel_columns<L: Lanes>(origin_x: f32) -> [L; GROUPS] {
    let mut columns = [L::splat(0.0); GROUPS];
    for (group, column) in columns.iter_mut().enumerate() {
        let x: [f32; LANES] = std::array::from_fn(|lane| origin_x + (group * LANES + lane) as f32);
        *column = L::load(&x);
    }
    columns
}

/// Lanes of a tile that lie outside the picture count as opaque from the start.
pub(crate) fn initial_transmittance(view: &View, column: usize, row: usize) -> TilePlane {
    let width = view.camera.width as usize - column * TILE;
    let height = view.camera.height as usize - row * TILE;
    std::array::from_fn(|group| {
        std::array::from_fn(|lane| {
            let (x, y) = (group % GROUPS * LANES + lane, group / GROUPS);
            if x < width && y < height { 1.0 } else { 0.0 }
        })
    })
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
        let (column, row) = (self.tile % self.view.tiles_across(), self.tile / self.view.tiles_across());
        let (origin_x, origin_y) = ((column * TILE) as f32, (row * TILE) as f32);
        let pixels_x = pixel_columns::<L>(origin_x);
        // `open` is the transmittance of pixels that still take splats, and 0 for those that have stopped.
        let mut open = initial_transmittance(self.view, column, row);
        let mut out = TilePixels { color: [EMPTY; 3], depth: EMPTY, transmittance: open };

        let members = &self.lists.gaussians[self.lists.tile_range(self.tile)];
        for (n, &i) in members.iter().enumerate() {
            if n % OPAQUE_CHECK == OPAQUE_CHECK - 1 && open.iter().flatten().all(|&t| t == 0.0) {
                break;
            }
            let splat = &self.lists.splats[i as usize];
            let wide = WideSplat::<L>::new(splat);
            for y in rows(splat, origin_y) {
                let dy = splat.y - (origin_y + y as f32);
                for group in groups(splat, origin_x, dy) {
                    let footprint = wide.footprint(pixels_x[group], L::splat(dy));
                    if !footprint.hit.any() {
                        continue;
                    }
                    let at = y * GROUPS + group;
                    let t = L::load(&open[at]);
                    let after = t.sub(t.mul(footprint.alpha));
                    let taken = footprint.hit.and(after.at_least(L::splat(MIN_TRANSMITTANCE)));
                    let weight = taken.and(t.mul(footprint.alpha));
                    for c in 0..3 {
                        weight.mul_add(wide.color[c], L::load(&out.color[c][at])).store(&mut out.color[c][at]);
                    }
                    weight.mul_add(wide.depth, L::load(&out.depth[at])).store(&mut out.depth[at]);
                    taken.select(after, L::load(&out.transmittance[at])).store(&mut out.transmittance[at]);
                    // Hit but not taken: the pixel stops.
                    footprint.hit.select(taken.and(after), t).store(&mut open[at]);
                }
            }
        }
        out
    }
}

/// Blends every tile. Outputs are in tile order.
pub(crate) fn rasterize(lists: &TileLists, view: &View) -> Vec<TilePixels> {
    (0..view.tiles_across() * view.tiles_down())
        .into_par_iter()
        .map(|tile| dispatch(RasterizeTile { lists, view, tile }))
        .collect()
}

/// Puts tiles together: colour over the background `[H, W, 3]`, then alpha `[H, W]`, then depth `[H, W]`.
///
/// One flat array with contiguous parts, since an operation on the tape has one output and contiguous slices are cheap.
pub(crate) fn assemble(tiles: &[TilePixels], view: &View) -> Vec<f32> {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let mut picture = vec![0.0; width * height * CHANNELS];
    let (image, rest) = picture.split_at_mut(3 * width * height);
    let (alpha, depth) = rest.split_at_mut(width * height);
    image
        .par_chunks_mut(3 * width)
        .zip(alpha.par_chunks_mut(width))
        .zip(depth.par_chunks_mut(width))
        .enumerate()
        .for_each(|(y, ((image, alpha), depth))| {
            for x in 0..width {
                let tile = &tiles[y / TILE * view.tiles_across() + x / TILE];
                let group = y % TILE * GROUPS + x % TILE / LANES;
                let lane = x % LANES;
                let t = tile.transmittance[group][lane];
                for c in 0..3 {
                    image[3 * x + c] = tile.color[c][group][lane] + t * view.background[c];
                }
                alpha[x] = 1.0 - t;
                depth[x] = tile.depth[group][lane];
            }
        });
    picture
}

/// Reads a tile of what [`assemble`] lays out into planes; pixels outside the picture are zero.
pub(crate) fn tile_of(picture: &[f32], view: &View, column: usize, row: usize) -> [TilePlane; CHANNELS] {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let (image, rest) = picture.split_at(3 * width * height);
    let (alpha, depth) = rest.split_at(width * height);
    let mut planes = [EMPTY; CHANNELS];
    for y in row * TILE..((row + 1) * TILE).min(height) {
        for x in column * TILE..((column + 1) * TILE).min(width) {
            let (group, lane) = (y % TILE * GROUPS + x % TILE / LANES, x % LANES);
            let pixel = y * width + x;
            for c in 0..3 {
                planes[c][group][lane] = image[3 * pixel + c];
            }
            planes[3][group][lane] = alpha[pixel];
            planes[4][group][lane] = depth[pixel];
        }
    }
    planes
}

pub(crate) const TILE_GROUPS: usize = GROUPS;
