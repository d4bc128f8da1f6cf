//! Bits under mixtures of logistics, eight values at a time, forward and backward.
//!
//! With `z` the distance of a value from a logistic's mean and `a` half the width of its interval, both in units of the logistic's
//! scale, and `t = |z|`, the mass of the interval is
//!
//! ```text
//! p = sinh a / (cosh a + cosh t)
//! ∂p/∂z = -p sinh z / (cosh a + cosh t),   ∂p/∂a = (1 + cosh a cosh t) / (cosh a + cosh t)²
//! ```
//!
//! All of it is multiplied by `2 exp(-max(a, t))`, so that nothing overflows, and nothing cancels far from the mean.

use std::f64::consts::LOG2_E;

use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::MOST_COMPONENTS;

type Block = [f32; LANES];

/// The inputs, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct MixtureSlices<'a> {
    /// `[C, N]`
    pub(super) values: &'a [f32],
    /// `[C]`
    pub(super) widths: &'a [f32],
    /// `[C, K]`
    pub(super) weight_logits: &'a [f32],
    /// `[C, K]`
    pub(super) means: &'a [f32],
    /// `[C, K]`
    pub(super) log_scales: &'a [f32],
}

/// Gradients of [`MixtureSlices`].
pub(super) struct MixtureGradients {
    pub(super) values: Vec<f32>,
    pub(super) widths: Vec<f32>,
    pub(super) weight_logits: Vec<f32>,
    pub(super) means: Vec<f32>,
    pub(super) log_scales: Vec<f32>,
}

/// A logistic, and the interval's width as it sees it.
#[derive(Clone, Copy, Default)]
struct Component {
    weight: f32,
    mean: f32,
    inverse_scale: f32,
    half_width: f32,
    /// `exp(-2 a)`, and what it leaves of 1.
    shrunk: f32,
    rest: f32,
}

/// A channel's density.
struct Mixture {
    components: [Component; MOST_COMPONENTS],
    count: usize,
}

impl MixtureSlices<'_> {
    fn channels(&self) -> usize {
        self.widths.len()
    }

    fn components(&self) -> usize {
        self.means.len() / self.channels().max(1)
    }

    fn values_of(&self, channel: usize) -> &[f32] {
        let count = self.values.len() / self.channels();
        &self.values[channel * count..(channel + 1) * count]
    }

    fn mixture(&self, channel: usize) -> Mixture {
        let count = self.components();
        let own = channel * count..(channel + 1) * count;
        let logits = &self.weight_logits[own.clone()];
        let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let power = |logit: f32| f64::from(logit - largest).exp();
        let sum: f64 = logits.iter().map(|logit| power(*logit)).sum();
        let mut components = [Component::default(); MOST_COMPONENTS];
        for (component, k) in components.iter_mut().zip(own) {
            let inverse_scale = (-f64::from(self.log_scales[k])).exp();
            let half_width = 0.5 * f64::from(self.widths[channel]) * inverse_scale;
            *component = Component {
                weight: (power(self.weight_logits[k]) / sum) as f32,
                mean: self.means[k],
                inverse_scale: inverse_scale as f32,
                half_width: half_width as f32,
                shrunk: (-2.0 * half_width).exp() as f32,
                rest: -(-2.0 * half_width).exp_m1() as f32,
            };
        }
        Mixture { components, count }
    }
}

/// The mass of the interval around eight values under one logistic, and its derivatives.
#[derive(Clone, Copy)]
struct Mass<L> {
    mass: L,
    distance: L,
    by_distance: L,
    by_half_width: L,
}

impl Component {
    #[inline(always)]
    fn mass<L: Lanes>(&self, values: L) -> Mass<L> {
        let one = L::splat(1.0);
        let zero = L::splat(0.0);
        let distance = values.sub(L::splat(self.mean)).mul(L::splat(self.inverse_scale));
        let beyond = distance.max(zero.sub(distance));
        let half_width = L::splat(self.half_width);
        let exponential = |x: L| x.mul(L::splat(std::f32::consts::LOG2_E)).exp2();
        let far = beyond.at_least(half_width);
        let gap = beyond.sub(half_width);
        let smaller = exponential(gap.min(zero.sub(gap)));
        let (of_width, of_distance) = (far.select(smaller, one), far.select(one, smaller));
        let shrunk = L::splat(self.shrunk);
        let shrunk_distance = exponential(beyond.mul(L::splat(-2.0)));
        let cosh_width = of_width.mul(one.add(shrunk));
        let cosh_distance = of_distance.mul(one.add(shrunk_distance));
        let inverse = one.div(cosh_width.add(cosh_distance));
        // NaN stays NaN.
        let mass = of_width.mul(L::splat(self.rest)).mul(inverse).add(distance.sub(distance));
        let sinh_distance = of_distance.mul(one.sub(shrunk_distance)).mul(inverse);
        let toward = zero.at_least(distance).select(sinh_distance, zero.sub(sinh_distance));
        let product = L::splat(4.0).mul(shrunk.min(shrunk_distance)).add(cosh_width.mul(cosh_distance));
        Mass { mass, distance, by_distance: mass.mul(toward), by_half_width: product.mul(inverse).mul(inverse) }
    }
}

impl Mixture {
    fn components(&self) -> &[Component] {
        &self.components[..self.count]
    }

    #[inline(always)]
    fn masses<L: Lanes>(&self, values: L) -> (L, [Mass<L>; MOST_COMPONENTS]) {
        let zero = L::splat(0.0);
        let nothing = Mass { mass: zero, distance: zero, by_distance: zero, by_half_width: zero };
        let mut masses = [nothing; MOST_COMPONENTS];
        let mut sum = zero;
        for (component, mass) in self.components().iter().zip(&mut masses) {
            *mass = component.mass(values);
            sum = mass.mass.mul_add(L::splat(component.weight), sum);
        }
        (sum, masses)
    }
}

/// The values of a channel in eights; behind the last there are others, which count for nothing.
fn blocks(values: &[f32]) -> impl Iterator<Item = (Block, usize)> {
    values.chunks(LANES).map(|chunk| {
        let mut block = [chunk[0]; LANES];
        block[..chunk.len()].copy_from_slice(chunk);
        (block, chunk.len())
    })
}

struct BitsOfChannel<'a> {
    mixture: Mixture,
    values: &'a [f32],
    bound: f32,
}

impl LaneKernel for BitsOfChannel<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<L: Lanes>(self) -> f32 {
        let mut bits = 0.0;
        for (values, count) in blocks(self.values) {
            let mut likelihoods = [0.0; LANES];
            // In this order, NaN stays NaN.
            L::splat(self.bound).max(self.mixture.masses(L::load(&values)).0).store(&mut likelihoods);
            bits -= likelihoods[..count].iter().map(|likelihood| f64::from(likelihood.log2())).sum::<f64>();
        }
        bits as f32
    }
}

/// Bits of each channel.
pub(super) fn bits_of_slices(inputs: &MixtureSlices, bound: f32) -> Vec<f32> {
    let of_channel = |channel| {
        dispatch(BitsOfChannel { mixture: inputs.mixture(channel), values: inputs.values_of(channel), bound })
    };
    (0..inputs.channels()).into_par_iter().map(of_channel).collect()
}

/// Sums over the values of a channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    width: f32,
    weight_logits: [f32; MOST_COMPONENTS],
    means: [f32; MOST_COMPONENTS],
    log_scales: [f32; MOST_COMPONENTS],
}

struct GradientsOfChannel<'a> {
    mixture: Mixture,
    values: &'a [f32],
    of_values: &'a mut [f32],
    bound: f32,
    upstream: f32,
}

impl LaneKernel for GradientsOfChannel<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Sums {
        let Self { mixture, values, of_values, bound, upstream } = self;
        let zero = L::splat(0.0);
        let mut width = zero;
        let mut sums = [[zero; MOST_COMPONENTS]; 3];
        let slope = L::splat((-LOG2_E * f64::from(upstream)) as f32);
        for ((values, count), of_values) in blocks(values).zip(of_values.chunks_mut(LANES)) {
            let (likelihood, masses) = mixture.masses(L::load(&values));
            let bounded = L::splat(bound).max(likelihood);
            let mut by_likelihood = slope.div(bounded);
            if upstream <= 0.0 {
                // A step along this gradient would lower the likelihood further below the bound.
                by_likelihood = L::splat(bound).at_least(bounded).and_not(by_likelihood);
            }
            let mut counts = [0.0; LANES];
            counts[..count].fill(1.0);
            by_likelihood = by_likelihood.mul(L::load(&counts));
            let mut of_block = zero;
            for (k, (component, mass)) in mixture.components().iter().zip(&masses).enumerate() {
                let weighted = by_likelihood.mul(L::splat(component.weight));
                let by_distance = weighted.mul(mass.by_distance);
                let by_half_width = weighted.mul(mass.by_half_width);
                of_block = by_distance.mul_add(L::splat(component.inverse_scale), of_block);
                width = by_half_width.mul_add(L::splat(0.5 * component.inverse_scale), width);
                let by_log_scale =
                    by_distance.mul_add(mass.distance, by_half_width.mul(L::splat(component.half_width)));
                sums[0][k] = weighted.mul_add(mass.mass.sub(likelihood), sums[0][k]);
                sums[1][k] = sums[1][k].sub(by_distance.mul(L::splat(component.inverse_scale)));
                sums[2][k] = sums[2][k].sub(by_log_scale);
            }
            let mut block = [0.0; LANES];
            of_block.store(&mut block);
            of_values.copy_from_slice(&block[..count]);
        }
        let [weight_logits, means, log_scales] = sums.map(|sums| sums.map(L::sum));
        Sums { width: width.sum(), weight_logits, means, log_scales }
    }
}

/// Gradients from those of the channels' bits.
pub(super) fn mixture_bits_backward(inputs: &MixtureSlices, bound: f32, upstream: &[f32]) -> MixtureGradients {
    let count = inputs.values.len() / inputs.channels().max(1);
    let mut of_values = vec![0.0; inputs.values.len()];
    let mut sums: Vec<Sums> = of_values
        .par_chunks_mut(count.max(1))
        .zip(upstream)
        .enumerate()
        .map(|(channel, (of_values, upstream))| {
            dispatch(GradientsOfChannel {
                mixture: inputs.mixture(channel),
                values: inputs.values_of(channel),
                of_values,
                bound,
                upstream: *upstream,
            })
        })
        .collect();
    // Without values there is no chunk of them.
    sums.resize(inputs.channels(), Sums::default());
    let components = inputs.components();
    let all = |of: fn(&Sums) -> &[f32; MOST_COMPONENTS]| {
        sums.iter().flat_map(|sums| &of(sums)[..components]).copied().collect()
    };
    MixtureGradients {
        widths: sums.iter().map(|sums| sums.width).collect(),
        weight_logits: all(|sums| &sums.weight_logits),
        means: all(|sums| &sums.means),
        log_scales: all(|sums| &sums.log_scales),
        values: of_values,
    }
}
