//! Front-to-back traversal of one tile's splats, eight pixels at a time, for blending, its derivative and the significance
//! scores.
//!
//! A group of eight pixels is four columns of two rows. Most splats are a few pixels wide, and it takes fewer such groups to cover
//! one than rows of eight.
//!
//! A group is visited if the splat's alpha can reach it and at least one of its pixels still takes splats. The traversal
//! ends when all pixels have stopped. So the cost is proportional to the number of blended pixels. For each pixel, front
//! to back:
//!
//! ```text
//! alpha = min(0.99, opacity · exp(-q)),  skipped below 1/255
//! stop before the splat that would take the transmittance T below 1e-4
//! weight = T · alpha,  T *= 1 - alpha
//! ```

use light4gs_codec::rendering::{MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE, TILE};

use super::project::Splat;
use super::tiles::TileLists;
use crate::lanes::{LANES, Lanes};
use crate::view::View;

/// Columns of a group of eight pixels.
pub(crate) const WIDTH: usize = 4;
/// Its rows.
const HEIGHT: usize = LANES / WIDTH;
/// Groups of a tile next to each other, and below each other.
const ACROSS: usize = TILE / WIDTH;
const DOWN: usize = TILE / HEIGHT;
/// Groups in a tile, column by column.
pub(crate) const GROUPS: usize = ACROSS * DOWN;
// Sets of groups are 32-bit masks.
const _: () = assert!(GROUPS <= u32::BITS as usize);
// The rows of groups are examined all at once.
const _: () = assert!(DOWN == LANES);

/// One value for every pixel of a tile, by group.
pub(crate) type TilePlane = [[f32; LANES]; GROUPS];

/// Group and lanes of four pixels next to each other, from the tile's upper left corner; `x` is a multiple of four.
pub(crate) fn group_and_lanes(x: usize, y: usize) -> (usize, std::ops::Range<usize>) {
    let (group, first) = group_and_lane(x, y);
    (group, first..first + WIDTH)
}

/// Group and lane of a pixel, from the tile's upper left corner.
fn group_and_lane(x: usize, y: usize) -> (usize, usize) {
    (x / WIDTH * DOWN + y / HEIGHT, y % HEIGHT * WIDTH + x % WIDTH)
}

/// The contribution of one splat to eight pixels.
pub(crate) struct Contribution<L> {
    /// The pixels.
    pub(crate) group: usize,
    /// Offsets from the pixels to the center of the splat.
    pub(crate) dx: L,
    pub(crate) dy: L,
    /// After the clamp at [`MAX_ALPHA`], of all lanes.
    pub(crate) alpha: L,
    /// T before this splat, valid where it is taken.
    pub(crate) transmittance: L,
    /// `T · alpha`, zero where the splat is not taken.
    pub(crate) weight: L,
    /// Mask: the pixel takes the splat.
    pub(crate) taken: L,
    /// Mask: the alpha was not clamped, so it still depends on the splat.
    pub(crate) free: L,
}

/// What is computed during the traversal.
pub(crate) trait TileVisitor<L: Lanes> {
    /// The values of one splat. They are separate from the visitor so that they stay in vector registers.
    type Splat;

    /// `n` counts the tile's splats from the front.
    fn begin(&self, n: usize, splat: &Splat) -> Self::Splat;
    fn visit(&mut self, splat: &mut Self::Splat, contribution: &Contribution<L>);
    /// Only splats that hit a pixel get here.
    fn end(&mut self, n: usize, splat: Self::Splat);
}

/// For each of a tile's splats from the front: the set of groups in which its alpha reaches the threshold.
pub(crate) enum Hits<'a> {
    /// Not needed.
    Unasked,
    /// To be found: each splat's set is appended.
    Found(&'a mut Vec<u32>),
    /// Found by an earlier traversal: only these groups are visited, and no splats after these.
    Known(&'a [u32]),
}

/// Passes all splats of a tile to the visitor. Returns the transmittance that remains at each pixel.
#[inline(always)]
pub(crate) fn walk<L: Lanes, V: TileVisitor<L>>(
    lists: &TileLists,
    view: &View,
    tile: usize,
    visitor: &mut V,
    mut hits: Hits,
) -> TilePlane {
    let (column, row) = (tile % view.tiles_across(), tile / view.tiles_across());
    let places = Places::<L>::new(column, row);
    let mut pixels = pixels_at_start(view, column, row);
    let mut live = live_groups(&pixels);

    let mut gaussians = &lists.gaussians[lists.tile_range(tile)];
    if let Hits::Known(sets) = &hits {
        gaussians = &gaussians[..sets.len()];
    }
    for (n, &i) in gaussians.iter().enumerate() {
        if live == 0 {
            break;
        }
        let splat = &lists.splats[i as usize];
        let mut groups = match &hits {
            Hits::Known(sets) => sets[n],
            _ => reached(splat, places.left, &places.rows),
        };
        groups &= live;
        let mut hit_groups = 0;
        let ellipse = Ellipse::<L>::new(splat);
        let mut state = visitor.begin(n, splat);
        while groups != 0 {
            let group = groups.trailing_zeros() as usize;
            groups &= groups - 1;
            let footprint = ellipse.footprint(places.x[group / DOWN], places.y[group % DOWN]);
            let Footprint { dx, dy, alpha, free, hit } = footprint;
            hit_groups |= u32::from(hit.signs() != 0) << group;
            let before = Pixels::<L>::load(&pixels[group]);
            let Blended { after, taken, weight } = before.blend(alpha, hit);
            after.store(&mut pixels[group]);
            if after.have_all_stopped() {
                live &= !(1 << group);
            }
            let transmittance = before.signed_transmittance;
            visitor.visit(&mut state, &Contribution { group, dx, dy, alpha, transmittance, weight, taken, free });
        }
        if hit_groups != 0 {
            visitor.end(n, state);
        }
        if let Hits::Found(sets) = &mut hits {
            sets.push(hit_groups);
        }
    }
    pixels.map(|lanes| lanes.map(f32::abs))
}

/// The sign bit alone. Set in a transmittance, which is never negative itself, it means that the pixel has stopped: it takes
/// no splats any more. So one number a pixel is loaded and stored in the innermost loop, not two.
const STOPPED: f32 = -0.0;

/// The state of eight pixels between two splats.
#[derive(Clone, Copy)]
struct Pixels<L> {
    /// T, with the sign [`STOPPED`] where the pixel has stopped.
    signed_transmittance: L,
}

/// Eight pixels after a splat.
struct Blended<L> {
    after: Pixels<L>,
    /// Mask: the pixel takes the splat.
    taken: L,
    /// `T · alpha`, zero where the splat is not taken.
    weight: L,
}

impl<L: Lanes> Pixels<L> {
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self { signed_transmittance: L::load(from) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        self.signed_transmittance.store(to);
    }

    /// A pixel that the splat hits takes it, or stops where T would sink below its minimum. A stopped pixel has a negative T,
    /// which is below the minimum too.
    #[inline(always)]
    fn blend(self, alpha: L, hit: L) -> Blended<L> {
        let before = self.signed_transmittance;
        let weight = before.mul(alpha);
        let after = before.sub(weight);
        let taken = hit.and(after.at_least(L::splat(MIN_TRANSMITTANCE)));
        let stops = taken.and_not(hit);
        let stopped = before.or(stops.and(L::splat(STOPPED)));
        Blended { after: Self { signed_transmittance: taken.select(after, stopped) }, taken, weight: taken.and(weight) }
    }

    #[inline(always)]
    fn have_all_stopped(self) -> bool {
        self.signed_transmittance.signs() == (1 << LANES) - 1
    }
}

/// T = 1 at each pixel. Those outside the image have stopped from the beginning.
fn pixels_at_start(view: &View, column: usize, row: usize) -> TilePlane {
    let width = view.camera.width as usize - column * TILE;
    let height = view.camera.height as usize - row * TILE;
    let mut pixels = [[1.0f32; LANES]; GROUPS];
    for (y, x) in (0..TILE).flat_map(|y| (0..TILE).map(move |x| (y, x))) {
        if x >= width || y >= height {
            let (group, lane) = group_and_lane(x, y);
            pixels[group][lane] = 1.0f32.copysign(STOPPED);
        }
    }
    pixels
}

/// A bit for every group with a pixel that still takes splats.
fn live_groups(pixels: &TilePlane) -> u32 {
    let is_live = |lanes: &[f32; LANES]| lanes.iter().any(|pixel| pixel.is_sign_positive());
    pixels.iter().enumerate().fold(0, |bits, (group, lanes)| bits | u32::from(is_live(lanes)) << group)
}

/// Where the pixels of a tile are in the image.
struct Places<L> {
    /// The tile's first column.
    left: f32,
    /// Columns of the pixels of a group, for the groups next to each other.
    x: [L; ACROSS],
    /// Rows of the pixels of a group, for the groups below each other.
    y: [L; DOWN],
    /// The same rows, ordered for [`reached`].
    rows: [L; HEIGHT],
}

impl<L: Lanes> Places<L> {
    #[inline(always)]
    fn new(column: usize, row: usize) -> Self {
        let (left, top) = ((column * TILE) as f32, (row * TILE) as f32);
        Self {
            left,
            x: coordinates(|group, lane| left + (group * WIDTH + lane % WIDTH) as f32),
            y: coordinates(|group, lane| top + (group * HEIGHT + lane / WIDTH) as f32),
            rows: rows(top),
        }
    }
}

/// The splat's exponent, with each value in all lanes.
struct Ellipse<L> {
    x: L,
    y: L,
    opacity: L,
    /// Factors of dx², dx dy and dy² in the base-2 logarithm of the Gaussian.
    xx: L,
    xy: L,
    yy: L,
}

/// A splat at eight pixels.
struct Footprint<L> {
    dx: L,
    dy: L,
    alpha: L,
    free: L,
    /// Mask: alpha reaches the threshold.
    hit: L,
}

impl<L: Lanes> Ellipse<L> {
    #[inline(always)]
    fn new(splat: &Splat) -> Self {
        const LOG2_E: f32 = std::f32::consts::LOG2_E;
        let [a, b, c] = splat.conic;
        Self {
            x: L::splat(splat.x),
            y: L::splat(splat.y),
            opacity: L::splat(splat.opacity),
            xx: L::splat(-0.5 * LOG2_E * a),
            xy: L::splat(-LOG2_E * b),
            yy: L::splat(-0.5 * LOG2_E * c),
        }
    }

    #[inline(always)]
    fn footprint(&self, pixels_x: L, pixels_y: L) -> Footprint<L> {
        let (dx, dy) = (self.x.sub(pixels_x), self.y.sub(pixels_y));
        let power = self.xx.mul_add(dx, self.xy.mul(dy)).mul_add(dx, self.yy.mul(dy).mul(dy));
        let raw = self.opacity.mul(power.exp2());
        let alpha = raw.min(L::splat(MAX_ALPHA));
        let hit = alpha.at_least(L::splat(MIN_ALPHA)).and(L::splat(0.0).at_least(power));
        Footprint { dx, dy, alpha, free: L::splat(MAX_ALPHA).at_least(raw), hit }
    }
}

/// A bit for every group that the splat's alpha can reach, for all rows of the tile at once. `rows_y` come from [`rows`].
#[inline(always)]
fn reached<L: Lanes>(splat: &Splat, origin_x: f32, rows_y: &[L; HEIGHT]) -> u32 {
    let [a, b, _] = splat.conic;
    // In a row, the form has its minimum at dx = -b dy / a, where it is dy² / variance. A small margin is added, since
    // the pixels evaluate the form with other rounding.
    let (inverse_a, inverse_variance) = (L::splat(1.0 / a), L::splat(-1.0 / splat.variance[1]));
    let (reach, skew) = (L::splat(splat.reach * 1.002 + 1e-2), L::splat(b / a));
    let (x, y) = (L::splat(splat.x - origin_x), L::splat(splat.y));
    let nowhere = L::splat(f32::INFINITY);
    // The first and last column that the splat reaches in each row; the first is infinite where it reaches none.
    let (mut low, mut high) = ([nowhere; HEIGHT], [nowhere; HEIGHT]);
    for row in 0..HEIGHT {
        let dy = y.sub(rows_y[row]);
        let left = dy.mul(dy).mul_add(inverse_variance, reach);
        let half_width = left.max(L::splat(0.0)).mul(inverse_a).sqrt().mul_add(L::splat(1.001), L::splat(0.05));
        let center = skew.mul_add(dy, x);
        low[row] = left.at_least(L::splat(0.0)).select(center.sub(half_width), nowhere);
        high[row] = center.add(half_width);
    }
    let mut bits = 0;
    for group in 0..ACROSS {
        let first = (group * WIDTH) as f32;
        let last = first + (WIDTH - 1) as f32;
        let mut columns = L::splat(0.0);
        for row in 0..HEIGHT {
            let here = high[row].at_least(L::splat(first)).and(L::splat(last).at_least(low[row]));
            columns = columns.or(here);
        }
        bits |= columns.signs() << (group * DOWN);
    }
    bits
}

/// A coordinate of the pixels of each group along one side of the tile, by group and lane.
#[inline(always)]
fn coordinates<L: Lanes, const N: usize>(coordinate: impl Fn(usize, usize) -> f32) -> [L; N] {
    let mut vectors = [L::splat(0.0); N];
    for (group, vector) in vectors.iter_mut().enumerate() {
        let values: [f32; LANES] = std::array::from_fn(|lane| coordinate(group, lane));
        *vector = L::load(&values);
    }
    vectors
}

/// The rows of all groups from the row `first` on: their upper ones, then their lower ones.
#[inline(always)]
fn rows<L: Lanes>(first: f32) -> [L; HEIGHT] {
    coordinates(|row, group| first + (group * HEIGHT + row) as f32)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use light4gs_data::Camera;
    use proptest::prelude::*;

    use super::super::project::{GaussianSlices, project};
    use super::*;
    use crate::lanes::{LaneKernel, Portable, dispatch};

    const SIDE: usize = 3 * TILE;

    struct Reached<'a>(&'a Splat, [f32; 2]);
    impl LaneKernel for Reached<'_> {
        type Output = u32;
        fn run<L: Lanes>(self) -> u32 {
            reached(self.0, self.1[0], &rows::<L>(self.1[1]))
        }
    }

    proptest! {
        /// For any shape of the splat, no pixel that it touches is left out.
        #[test]
        fn every_touched_pixel_is_in_a_reached_group(
            mean in prop::array::uniform3(-1.5f32..1.5),
            quat in prop::array::uniform4(0.1f32..1.0),
            log_scales in prop::array::uniform3(-5.0f32..0.5),
            opacity in 0.001f32..1.0,
        ) {
            let camera = Camera::look_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, Vec3::Y, 0.8, SIDE as u32, SIDE as u32);
            let view = View { camera, background: [0.0; 3], sh_degree: 0 };
            let gaussian = GaussianSlices {
                means: &mean,
                quats: &quat,
                scales: &log_scales.map(f32::exp),
                opacities: &[opacity],
                sh_dc: &[0.0; 3],
                sh_rest: &[],
                screen_offsets: &[0.0; 2],
            };
            let splat = project(&gaussian, 0, &view);
            let [a, b, c] = splat.conic;
            for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                let origin = [(column * TILE) as f32, (row * TILE) as f32];
                for groups in [dispatch(Reached(&splat, origin)), Reached(&splat, origin).run::<Portable>()] {
                    for (y, x) in (0..TILE).flat_map(|y| (0..TILE).map(move |x| (y, x))) {
                        let (dx, dy) = (splat.x - origin[0] - x as f32, splat.y - origin[1] - y as f32);
                        let alpha = opacity * (-0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy).exp();
                        let (group, _) = group_and_lane(x, y);
                        prop_assert!(alpha < MIN_ALPHA || groups >> group & 1 == 1, "pixel {x} {y}: alpha {alpha}");
                    }
                }
            }
        }
    }
}
