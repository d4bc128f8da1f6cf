//! Derivative of the blending with respect to every splat, front to back like the forward pass.
//!
//! With `v_i` the splat's color and depth weighted by the upstream gradient, the pixel's value is `S = sum_i w_i v_i +
//! T_end · v_background`, and `dS/dalpha_i = T_i v_i - (S - sum_{j<=i} w_j v_j) / (1 - alpha_i)`. `S` is known from the
//! forward pass, so a running prefix is enough: no second, reversed traversal is needed, and no division to recover the
//! transmittance. Every (tile, Gaussian) pair writes its own sums. Each Gaussian then adds up its tiles in a fixed
//! order, so that the result does not depend on the threads.

use rayon::prelude::*;

use super::blend::{Contribution, GROUPS, Hits, TilePlane, TileVisitor, walk};
use super::project::{GaussianSlices, Splat, SplatGradient, project_backward};
use super::rasterize::{CHANNELS, TilePixels, tile_of};
use super::tiles::TileLists;
use crate::lanes::{LANES, LaneKernel, Lanes, dispatch};
use crate::view::View;

/// Sums of one splat over one tile's pixels: gradients of color and depth, then the moments of
/// `p = alpha · dS/dalpha`: p, p dx, p dy, p dx², p dx dy, p dy².
type Sums = [f32; 10];

struct BackwardTile<'a> {
    lists: &'a TileLists,
    view: &'a View,
    trained: usize,
    tile: usize,
    pixels: &'a TilePixels,
    /// In the layout of [`assemble`](super::rasterize::assemble).
    upstream: &'a [f32],
    sums: &'a mut [Sums],
}

impl LaneKernel for BackwardTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let view = self.view;
        let hits = &self.pixels.hits;
        let gaussians = &self.lists.gaussians[self.lists.tile_range(self.tile)][..hits.len()];
        // `S` contains what lies behind the last of them.
        let is_needed = |(gaussian, hits): (&u32, &u32)| (*gaussian as usize) < self.trained && *hits != 0;
        let Some(last) = gaussians.iter().zip(hits).rposition(is_needed) else { return };
        let (column, row) = (self.tile % view.tiles_across(), self.tile / view.tiles_across());
        let upstream = tile_of(self.upstream, view, column, row);
        let rest = total_value::<L>(self.pixels, &upstream, view.background);
        let mut visitor = Differentiate { gaussians, trained: self.trained, upstream, rest, sums: self.sums };
        walk::<L, _>(self.lists, view, self.tile, &mut visitor, Hits::Known(&hits[..=last]));
    }
}

struct Differentiate<'a> {
    /// The tile's Gaussians, front to back.
    gaussians: &'a [u32],
    trained: usize,
    upstream: [TilePlane; CHANNELS],
    /// `S` minus the contributions of the splats so far.
    rest: TilePlane,
    sums: &'a mut [Sums],
}

/// One splat's values and, lane by lane, its sums.
struct Accumulator<L> {
    /// Whether its sums are needed.
    trained: bool,
    color: [L; 3],
    depth: L,
    linear: [L; 4],
    moments: [L; 6],
}

impl<L: Lanes> TileVisitor<L> for Differentiate<'_> {
    type Splat = Accumulator<L>;

    #[inline(always)]
    fn begin(&self, n: usize, splat: &Splat) -> Accumulator<L> {
        let [red, green, blue] = splat.color;
        Accumulator {
            trained: (self.gaussians[n] as usize) < self.trained,
            // Written out: with a call that is not inlined, values leave the vector registers.
            color: [L::splat(red), L::splat(green), L::splat(blue)],
            depth: L::splat(splat.depth),
            linear: [L::splat(0.0); 4],
            moments: [L::splat(0.0); 6],
        }
    }

    #[inline(always)]
    fn visit(&mut self, splat: &mut Accumulator<L>, contribution: &Contribution<L>) {
        let Contribution { group, dx, dy, alpha, weight, taken, free, .. } = *contribution;
        let up = load_all::<L>(&self.upstream, group);
        let Accumulator { trained, color, depth, linear, moments } = splat;
        let value = color[0].mul_add(up[0], color[1].mul_add(up[1], color[2].mul_add(up[2], depth.mul(up[4]))));
        let here = weight.mul(value);
        let left = L::load(&self.rest[group]).sub(here);
        left.store(&mut self.rest[group]);
        if !*trained {
            return;
        }
        for c in 0..3 {
            linear[c] = weight.mul_add(up[c], linear[c]);
        }
        linear[3] = weight.mul_add(up[4], linear[3]);
        // alpha · dS/dalpha, with alpha folded into the weight.
        let behind = alpha.mul(left).div(L::splat(1.0).sub(alpha));
        let p = taken.and(free).and(here.sub(behind));
        let (px, py) = (p.mul(dx), p.mul(dy));
        moments[0] = moments[0].add(p);
        moments[1] = moments[1].add(px);
        moments[2] = moments[2].add(py);
        moments[3] = px.mul_add(dx, moments[3]);
        moments[4] = px.mul_add(dy, moments[4]);
        moments[5] = py.mul_add(dy, moments[5]);
    }

    #[inline(always)]
    fn end(&mut self, n: usize, splat: Accumulator<L>) {
        if !splat.trained {
            return;
        }
        let sums = &mut self.sums[n];
        let Accumulator { linear: l, moments: m, .. } = splat;
        sums[..LANES].copy_from_slice(&L::sums(&[l[0], l[1], l[2], l[3], m[0], m[1], m[2], m[3]]));
        sums[LANES] = m[4].sum();
        sums[LANES + 1] = m[5].sum();
    }
}

/// A loop, not `array::from_fn`: with a call that is not inlined, values leave the vector registers.
#[inline(always)]
fn load_all<L: Lanes>(planes: &[TilePlane; CHANNELS], at: usize) -> [L; 5] {
    let mut values = [L::splat(0.0); 5];
    for (value, plane) in values.iter_mut().zip(planes) {
        *value = L::load(&plane[at]);
    }
    values
}

/// `S` of every pixel: the final sums weighted by the upstream gradient.
#[inline(always)]
fn total_value<L: Lanes>(pixels: &TilePixels, upstream: &[TilePlane; CHANNELS], background: [f32; 3]) -> TilePlane {
    let mut total = [[0.0; LANES]; GROUPS];
    for at in 0..total.len() {
        let up = load_all::<L>(upstream, at);
        // The background's value; alpha is 1 - T, hence the minus.
        let mut behind = L::splat(0.0).sub(up[3]);
        let mut value = up[4].mul(L::load(&pixels.depth[at]));
        for c in 0..3 {
            behind = up[c].mul_add(L::splat(background[c]), behind);
            value = up[c].mul_add(L::load(&pixels.color[c][at]), value);
        }
        L::load(&pixels.transmittance[at]).mul_add(behind, value).store(&mut total[at]);
    }
    total
}

/// Gradients of all inputs, in the layouts of [`GaussianSlices`]. Those of Gaussians that are not trained are zero.
#[derive(Clone, Debug)]
pub struct GaussianGradients {
    /// `[N, 3]`.
    pub means: Vec<f32>,
    /// `[N, 4]`, before the normalization.
    pub quats: Vec<f32>,
    /// `[N, 3]`.
    pub scales: Vec<f32>,
    /// `[N]`.
    pub opacities: Vec<f32>,
    /// `[N, 1, 3]`.
    pub sh_dc: Vec<f32>,
    /// `[N, K, 3]`.
    pub sh_rest: Vec<f32>,
    /// `[N, 2]`.
    pub screen_offsets: Vec<f32>,
}

/// Chain rule from the gradient of an image to those of the Gaussians. `gaussians`, `view` and `lists` are those of the
/// image, and `pixels` those of [`rasterize`](crate::rasterize). `upstream` is the gradient of the loss by
/// the `5 H W` numbers of [`assemble`](crate::assemble), in the same layout. Only the first `trained` Gaussians get gradients.
pub fn splat_backward(
    gaussians: &GaussianSlices,
    trained: usize,
    view: &View,
    lists: &TileLists,
    pixels: &[TilePixels],
    upstream: &[f32],
) -> GaussianGradients {
    let mut sums: Vec<Sums> = vec![[0.0; 10]; lists.gaussians.len()];
    lists.split_by_tile(&mut sums).into_par_iter().enumerate().for_each(|(tile, sums)| {
        dispatch(BackwardTile { lists, view, trained, tile, pixels: &pixels[tile], upstream, sums });
    });

    let count = gaussians.len();
    let rest = gaussians.sh_rest.len() / count.max(1);
    let mut out = GaussianGradients {
        means: vec![0.0; 3 * count],
        quats: vec![0.0; 4 * count],
        scales: vec![0.0; 3 * count],
        opacities: vec![0.0; count],
        sh_dc: vec![0.0; 3 * count],
        sh_rest: vec![0.0; rest * count],
        screen_offsets: vec![0.0; 2 * count],
    };
    const CHUNK: usize = 256;
    let rest_chunks: Vec<&mut [f32]> = if rest == 0 {
        (0..count.div_ceil(CHUNK)).map(|_| &mut [][..]).collect()
    } else {
        out.sh_rest.chunks_mut(rest * CHUNK).collect()
    };
    out.means
        .par_chunks_mut(3 * CHUNK)
        .zip(out.quats.par_chunks_mut(4 * CHUNK))
        .zip(out.scales.par_chunks_mut(3 * CHUNK))
        .zip(out.opacities.par_chunks_mut(CHUNK))
        .zip(out.sh_dc.par_chunks_mut(3 * CHUNK))
        .zip(rest_chunks)
        .zip(out.screen_offsets.par_chunks_mut(2 * CHUNK))
        .enumerate()
        .for_each(|(chunk, ((((((means, quats), scales), opacities), dc), sh_rest), offsets))| {
            for (k, opacity) in opacities.iter_mut().enumerate() {
                let i = chunk * CHUNK + k;
                if i >= trained {
                    break;
                }
                let Some(total) = lists.sum_of(i, &sums) else { continue };
                let splat = &lists.splats[i];
                let gradient = splat_gradient(splat.conic, splat.opacity, total);
                *opacity = gradient.opacity;
                let attributes = project_backward(
                    gaussians,
                    i,
                    view,
                    splat,
                    &gradient,
                    &mut dc[3 * k..3 * k + 3],
                    &mut sh_rest[rest * k..rest * (k + 1)],
                );
                attributes.mean.write_to_slice(&mut means[3 * k..]);
                quats[4 * k..4 * k + 4].copy_from_slice(&attributes.quat);
                attributes.scale.write_to_slice(&mut scales[3 * k..]);
                attributes.screen_offset.write_to_slice(&mut offsets[2 * k..]);
            }
        });
    out
}

/// From moments of `p` to the gradient of the splat. `p` is the gradient of the exponent `-(a dx² + c dy²)/2 - b dx
/// dy`, and `alpha` is proportional to the opacity.
fn splat_gradient([a, b, c]: [f32; 3], opacity: f32, sums: Sums) -> SplatGradient {
    let [red, green, blue, depth, p, px, py, pxx, pxy, pyy] = sums;
    SplatGradient {
        position: [-a * px - b * py, -b * px - c * py],
        conic: [-0.5 * pxx, -pxy, -0.5 * pyy],
        opacity: p / opacity,
        color: [red, green, blue],
        depth,
    }
}
