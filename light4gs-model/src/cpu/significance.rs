//! What every splat contributes to one picture, without its colour: the sums behind significance pruning.
//!
//! The same traversal and the same decisions as the blending. Every (tile, Gaussian) pair writes its own sums and each
//! Gaussian adds up its tiles in a fixed order, so that the scores do not depend on the threads.

use rayon::prelude::*;

use super::lanes::{LaneKernel, Lanes, dispatch};
use super::project::{TILE, View};
use super::rasterize::{MIN_TRANSMITTANCE, TILE_GROUPS, WideSplat, groups, initial_transmittance, pixel_columns, rows};
use super::tiles::TileLists;

/// Sums over the pixels that blend a splat: pixels, `T · alpha`, `T`.
type Sums = [f32; 3];
/// Values a Gaussian of the output: pixels, sum of `T · alpha`, sum of `T · opacity`, sum of the opacity.
pub(crate) const SCORES: usize = 4;

struct SignificanceTile<'a> {
    lists: &'a TileLists,
    view: &'a View,
    tile: usize,
    sums: &'a mut [Sums],
}

impl LaneKernel for SignificanceTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let view = self.view;
        let (column, row) = (self.tile % view.tiles_across(), self.tile / view.tiles_across());
        let (origin_x, origin_y) = ((column * TILE) as f32, (row * TILE) as f32);
        let pixels_x = pixel_columns::<L>(origin_x);
        let mut open = initial_transmittance(view, column, row);
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let members = &self.lists.gaussians[self.lists.tile_range(self.tile)];
        for (&i, sums) in members.iter().zip(self.sums) {
            let splat = &self.lists.splats[i as usize];
            let wide = WideSplat::<L>::new(splat);
            let (mut pixels, mut weights, mut transmittances) = (zero, zero, zero);
            for y in rows(splat, origin_y) {
                let dy = splat.y - (origin_y + y as f32);
                for group in groups(splat, origin_x, dy) {
                    let footprint = wide.footprint(pixels_x[group], L::splat(dy));
                    if !footprint.hit.any() {
                        continue;
                    }
                    let at = y * TILE_GROUPS + group;
                    let t = L::load(&open[at]);
                    let weight = t.mul(footprint.alpha);
                    let after = t.sub(weight);
                    let taken = footprint.hit.and(after.at_least(L::splat(MIN_TRANSMITTANCE)));
                    footprint.hit.select(taken.and(after), t).store(&mut open[at]);
                    pixels = pixels.add(taken.and(one));
                    weights = weights.add(taken.and(weight));
                    transmittances = transmittances.add(taken.and(t));
                }
            }
            *sums = [pixels.sum(), weights.sum(), transmittances.sum()];
        }
    }
}

/// Scores `[N, 4]` of one picture; see [`SCORES`].
pub(crate) fn significance(lists: &TileLists, view: &View) -> Vec<f32> {
    let mut sums: Vec<Sums> = vec![[0.0; 3]; lists.gaussians.len()];
    lists.split_by_tile(&mut sums).into_par_iter().enumerate().for_each(|(tile, sums)| {
        dispatch(SignificanceTile { lists, view, tile, sums });
    });

    let mut scores = vec![0.0; SCORES * lists.splats.len()];
    scores.par_chunks_mut(SCORES).enumerate().for_each(|(i, scores)| {
        let Some([pixels, weights, transmittances]) = lists.sum_of(i, &sums) else { return };
        let opacity = lists.splats[i].opacity;
        scores.copy_from_slice(&[pixels, weights, transmittances * opacity, pixels * opacity]);
    });
    scores
}
