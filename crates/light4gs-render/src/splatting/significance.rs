//! The contributions of every splat to one image, without its color: the sums for significance pruning.
//!
//! The traversal and its decisions are those of the blending. Every (tile, Gaussian) pair writes its own sums, and each
//! Gaussian adds up its tiles in a fixed order, so that the scores do not depend on the threads.

use rayon::prelude::*;

use super::blend::{Contribution, Hits, TileVisitor, walk};
use super::project::Splat;
use super::tiles::TileLists;
use crate::lanes::{LaneKernel, Lanes, dispatch};
use crate::view::View;

/// Sums over the pixels that blend a splat: pixels, `T · alpha`, `T`.
type Sums = [f32; 3];
/// Values of a Gaussian in the output: pixels, sum of `T · alpha`, sum of `T · opacity`.
pub const SCORES: usize = 3;

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
        walk::<L, _>(self.lists, self.view, self.tile, &mut Score(self.sums), Hits::Unasked);
    }
}

struct Score<'a>(&'a mut [Sums]);

impl<L: Lanes> TileVisitor<L> for Score<'_> {
    /// Pixels, `T · alpha`, `T`, lane by lane.
    type Splat = [L; 3];

    #[inline(always)]
    fn begin(&self, _: usize, _: &Splat) -> [L; 3] {
        [L::splat(0.0); 3]
    }

    #[inline(always)]
    fn visit(&mut self, [pixels, weights, transmittances]: &mut [L; 3], contribution: &Contribution<L>) {
        let Contribution { weight, transmittance, taken, .. } = *contribution;
        *pixels = pixels.add(taken.and(L::splat(1.0)));
        *weights = weights.add(weight);
        *transmittances = transmittances.add(taken.and(transmittance));
    }

    #[inline(always)]
    fn end(&mut self, n: usize, [pixels, weights, transmittances]: [L; 3]) {
        self.0[n] = [pixels.sum(), weights.sum(), transmittances.sum()];
    }
}

/// Scores `[N, 3]` of the Gaussians in one image, row-major; see [`SCORES`]. `lists` are those of the same `view`.
pub fn significance(lists: &TileLists, view: &View) -> Vec<f32> {
    let mut sums: Vec<Sums> = vec![[0.0; 3]; lists.gaussians.len()];
    lists.split_by_tile(&mut sums).into_par_iter().enumerate().for_each(|(tile, sums)| {
        dispatch(SignificanceTile { lists, view, tile, sums });
    });

    let mut scores = vec![0.0; SCORES * lists.splats.len()];
    scores.par_chunks_mut(SCORES).enumerate().for_each(|(i, scores)| {
        let Some([pixels, weights, transmittances]) = lists.sum_of(i, &sums) else { return };
        let opacity = lists.splats[i].opacity;
        scores.copy_from_slice(&[pixels, weights, transmittances * opacity]);
    });
    scores
}
