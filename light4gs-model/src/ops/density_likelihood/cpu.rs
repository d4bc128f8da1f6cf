//! Probabilities of intervals under learned densities, eight values at a time, forward and backward.
//!
//! With `l` the logits of an interval's edges, `s` its side of zero and `σ` the logistic function, the probability is
//! `|σ(s l₁) - σ(s l₀)|`. Backward, a layer `a = W l + b`, `l' = a + f tanh a` passes from a gradient `g` of its output
//!
//! ```text
//! ∂f = g tanh a,   ∂a = g (1 + f (1 - tanh² a)),   ∂b = ∂a,   ∂W = ∂a lᵀ,   ∂l = Wᵀ ∂a
//! ```
//!
//! summed over both edges and all values of a channel; last come the derivatives of softplus and tanh, through which the matrix and
//! the factor went.

use std::f32::consts::LOG2_E;

use burn::backend::tensor::FloatTensor;
use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::{DensityLayer, DensityLikelihoodKernels, DensityShape, DensityTensors, INPUTS, MOST_LAYERS, MOST_WIDTH};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

type Block = [f32; LANES];

/// The inputs, row by row.
#[derive(Clone, Copy, Debug)]
struct DensitySlices<'a> {
    /// `[C, N]`
    values: &'a [f32],
    /// `[C, P]`
    parameters: &'a [f32],
    shape: &'a DensityShape,
    width: f32,
}

/// A number for each parameter of a layer: matrix by output, bias, factor. What a layer lacks is not read.
#[derive(Clone, Copy)]
struct LayerNumbers<T> {
    matrix: [[T; MOST_WIDTH]; MOST_WIDTH],
    bias: [T; MOST_WIDTH],
    factor: [T; MOST_WIDTH],
}

impl<T: Copy> LayerNumbers<T> {
    fn all(value: T) -> Self {
        Self { matrix: [[value; MOST_WIDTH]; MOST_WIDTH], bias: [value; MOST_WIDTH], factor: [value; MOST_WIDTH] }
    }
}

/// A channel's network, with the matrices after softplus and the factors after tanh.
struct Network<'a> {
    layers: &'a [DensityLayer],
    weights: [LayerNumbers<f32>; MOST_LAYERS],
}

/// An edge of an interval on its way through the network.
#[derive(Clone, Copy)]
struct Edge<L> {
    /// What each layer gets.
    inputs: [[L; MOST_WIDTH]; MOST_LAYERS],
    /// `tanh a` of each layer that bends.
    bent: [[L; MOST_WIDTH]; MOST_LAYERS],
    logit: L,
}

fn softplus(x: f32) -> f32 {
    let x = f64::from(x);
    (x.max(0.0) + (-x.abs()).exp().ln_1p()) as f32
}

/// The derivative of [`softplus`].
fn softplus_slope(x: f32) -> f32 {
    let x = f64::from(x);
    (1.0 / (1.0 + (-x).exp())) as f32
}

impl DensitySlices<'_> {
    fn channels(&self) -> usize {
        self.parameters.len() / self.shape.parameters()
    }

    /// Values of a channel.
    fn count(&self) -> usize {
        self.values.len() / self.channels().max(1)
    }

    fn values_of(&self, channel: usize) -> &[f32] {
        &self.values[channel * self.count()..(channel + 1) * self.count()]
    }

    fn parameters_of(&self, channel: usize) -> &[f32] {
        &self.parameters[channel * self.shape.parameters()..(channel + 1) * self.shape.parameters()]
    }

    fn network(&self, channel: usize) -> Network<'_> {
        let parameters = self.parameters_of(channel);
        let layers = self.shape.layers();
        let mut weights = [LayerNumbers::all(0.0); MOST_LAYERS];
        for (layer, weights) in layers.iter().zip(&mut weights) {
            let matrix = parameters[layer.matrix()].chunks(layer.inputs);
            for (row, parameters) in weights.matrix.iter_mut().zip(matrix) {
                row.iter_mut().zip(parameters).for_each(|(weight, parameter)| *weight = softplus(*parameter));
            }
            weights.bias[..layer.outputs].copy_from_slice(&parameters[layer.bias()]);
            let factor = layer.factor().map_or(&[][..], |places| &parameters[places]);
            let bend = |parameter: f32| f64::from(parameter).tanh() as f32;
            weights.factor.iter_mut().zip(factor).for_each(|(weight, parameter)| *weight = bend(*parameter));
        }
        Network { layers, weights }
    }
}

/// `exp(-|x|)`
#[inline(always)]
fn shrunk<L: Lanes>(x: L) -> L {
    x.max(L::splat(0.0).sub(x)).mul(L::splat(-LOG2_E)).exp2()
}

/// The hyperbolic tangent to 1e-7.
#[inline(always)]
fn tanh<L: Lanes>(x: L) -> L {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let shrunk = shrunk(x.add(x));
    let size = one.sub(shrunk).div(one.add(shrunk));
    zero.at_least(x).select(zero.sub(size), size)
}

/// The logistic function, and its derivative.
#[inline(always)]
fn logistic<L: Lanes>(x: L) -> (L, L) {
    let one = L::splat(1.0);
    let shrunk = shrunk(x);
    let above = one.div(one.add(shrunk));
    let below = shrunk.mul(above);
    (x.at_least(L::splat(0.0)).select(above, below), below.mul(above))
}

/// Probability of the interval between two logits, and its derivatives by both.
#[inline(always)]
fn interval<L: Lanes>(lower: L, upper: L) -> (L, [L; 2]) {
    let zero = L::splat(0.0);
    let sum = lower.add(upper);
    let below = zero.at_least(sum);
    let on_side = |logit: L| below.select(logit, zero.sub(logit));
    let (of_lower, lower_slope) = logistic(on_side(lower));
    let (of_upper, upper_slope) = logistic(on_side(upper));
    let difference = of_upper.sub(of_lower);
    let likelihood = difference.max(zero.sub(difference));
    // Where the logits are equal, or so far out that the logistic functions are, no step makes a difference.
    let some = zero.at_least(likelihood);
    // Rounding may exchange the edges of a narrow interval.
    let straight = below.select(difference, zero.sub(difference)).at_least(zero);
    let signed = |slope: L| some.and_not(straight.select(slope, zero.sub(slope)));
    // NaN stays NaN.
    let likelihood = sum.at_least(sum).select(likelihood, sum);
    (likelihood, [zero.sub(signed(lower_slope)), signed(upper_slope)])
}

impl Network<'_> {
    #[inline(always)]
    fn edge<L: Lanes>(&self, x: L) -> Edge<L> {
        let zero = L::splat(0.0);
        let mut inputs = [[zero; MOST_WIDTH]; MOST_LAYERS];
        let mut bent = [[zero; MOST_WIDTH]; MOST_LAYERS];
        let mut logits = [x, zero, zero];
        for (k, (layer, weights)) in self.layers.iter().zip(&self.weights).enumerate() {
            inputs[k] = logits;
            for (o, logit) in logits.iter_mut().enumerate().take(layer.outputs) {
                let mut sum = L::splat(weights.bias[o]);
                for i in 0..layer.inputs {
                    sum = inputs[k][i].mul_add(L::splat(weights.matrix[o][i]), sum);
                }
                if layer.bends {
                    bent[k][o] = tanh(sum);
                    sum = bent[k][o].mul_add(L::splat(weights.factor[o]), sum);
                }
                *logit = sum;
            }
        }
        Edge { inputs, bent, logit: logits[0] }
    }

    #[inline(always)]
    fn edges<L: Lanes>(&self, values: L, width: f32) -> [Edge<L>; 2] {
        let half = L::splat(width / 2.0);
        [self.edge(values.sub(half)), self.edge(values.add(half))]
    }

    /// Adds an edge's gradients of the weights to `sums`, and returns that of its place.
    #[inline(always)]
    fn descend<L: Lanes>(&self, edge: &Edge<L>, of_logit: L, sums: &mut [LayerNumbers<L>; MOST_LAYERS]) -> L {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let mut of_outputs = [of_logit, zero, zero];
        for (k, layer) in self.layers.iter().enumerate().rev() {
            let (weights, sums) = (&self.weights[k], &mut sums[k]);
            let mut of_inputs = [zero; MOST_WIDTH];
            for o in 0..layer.outputs {
                let mut of_sum = of_outputs[o];
                if layer.bends {
                    let bent = edge.bent[k][o];
                    sums.factor[o] = of_sum.mul_add(bent, sums.factor[o]);
                    let slope = L::splat(weights.factor[o]).mul_add(one.sub(bent.mul(bent)), one);
                    of_sum = of_sum.mul(slope);
                }
                sums.bias[o] = sums.bias[o].add(of_sum);
                for i in 0..layer.inputs {
                    sums.matrix[o][i] = of_sum.mul_add(edge.inputs[k][i], sums.matrix[o][i]);
                    of_inputs[i] = of_sum.mul_add(L::splat(weights.matrix[o][i]), of_inputs[i]);
                }
            }
            of_outputs = of_inputs;
        }
        of_outputs[0]
    }
}

/// Numbers in eights; behind the last there are copies of `filler`.
fn block(numbers: &[f32], filler: f32) -> Block {
    let mut block = [filler; LANES];
    block[..numbers.len()].copy_from_slice(numbers);
    block
}

struct LikelihoodsOfChannel<'a> {
    network: Network<'a>,
    values: &'a [f32],
    likelihoods: &'a mut [f32],
    width: f32,
}

impl LaneKernel for LikelihoodsOfChannel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { network, values, likelihoods, width } = self;
        for (values, likelihoods) in values.chunks(LANES).zip(likelihoods.chunks_mut(LANES)) {
            let [lower, upper] = network.edges(L::load(&block(values, values[0])), width);
            let mut found = [0.0; LANES];
            interval(lower.logit, upper.logit).0.store(&mut found);
            likelihoods.copy_from_slice(&found[..likelihoods.len()]);
        }
    }
}

/// Probabilities of the intervals around all values.
fn likelihoods_of_slices(inputs: &DensitySlices) -> Vec<f32> {
    let mut likelihoods = vec![0.0; inputs.values.len()];
    likelihoods.par_chunks_mut(inputs.count().max(1)).enumerate().for_each(|(channel, likelihoods)| {
        let (network, values) = (inputs.network(channel), inputs.values_of(channel));
        dispatch(LikelihoodsOfChannel { network, values, likelihoods, width: inputs.width });
    });
    likelihoods
}

struct GradientsOfChannel<'a> {
    network: Network<'a>,
    values: &'a [f32],
    upstream: &'a [f32],
    of_values: &'a mut [f32],
    width: f32,
}

impl LaneKernel for GradientsOfChannel<'_> {
    type Output = [LayerNumbers<f32>; MOST_LAYERS];

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { network, values, upstream, of_values, width } = self;
        let mut sums = [LayerNumbers::all(L::splat(0.0)); MOST_LAYERS];
        let chunks = values.chunks(LANES).zip(upstream.chunks(LANES)).zip(of_values.chunks_mut(LANES));
        for ((values, upstream), of_values) in chunks {
            let [lower, upper] = network.edges(L::load(&block(values, values[0])), width);
            let (_, [by_lower, by_upper]) = interval(lower.logit, upper.logit);
            // What stands behind the last value counts for nothing.
            let upstream = L::load(&block(upstream, 0.0));
            let of_block = network.descend(&lower, upstream.mul(by_lower), &mut sums);
            let of_block = of_block.add(network.descend(&upper, upstream.mul(by_upper), &mut sums));
            let mut found = [0.0; LANES];
            of_block.store(&mut found);
            of_values.copy_from_slice(&found[..of_values.len()]);
        }
        sums.map(|sums| LayerNumbers {
            matrix: sums.matrix.map(|row| row.map(L::sum)),
            bias: sums.bias.map(L::sum),
            factor: sums.factor.map(L::sum),
        })
    }
}

/// Writes the gradients of a channel's parameters from those of its weights.
fn write_gradients(
    layers: &[DensityLayer],
    weights: &[LayerNumbers<f32>],
    of_weights: &[LayerNumbers<f32>],
    parameters: &[f32],
    gradients: &mut [f32],
) {
    for ((layer, weights), of_weights) in layers.iter().zip(weights).zip(of_weights) {
        for (k, place) in layer.matrix().enumerate() {
            let of_weight = of_weights.matrix[k / layer.inputs][k % layer.inputs];
            gradients[place] = of_weight * softplus_slope(parameters[place]);
        }
        gradients[layer.bias()].copy_from_slice(&of_weights.bias[..layer.outputs]);
        for (k, place) in layer.factor().into_iter().flatten().enumerate() {
            gradients[place] = of_weights.factor[k] * (1.0 - weights.factor[k] * weights.factor[k]);
        }
    }
}

/// Gradients of the values and of the parameters from those of the probabilities.
fn gradients_of_slices(inputs: &DensitySlices, upstream: &[f32]) -> [Vec<f32>; INPUTS] {
    let mut of_values = vec![0.0; inputs.values.len()];
    let mut of_parameters = vec![0.0; inputs.parameters.len()];
    let count = inputs.count();
    // Without values, those of the parameters stay zero.
    let rows = of_parameters.par_chunks_mut(inputs.shape.parameters());
    let rows = rows.zip(of_values.par_chunks_mut(count.max(1))).zip(upstream.par_chunks(count.max(1)));
    rows.enumerate().for_each(|(channel, ((gradients, of_values), upstream))| {
        let network = inputs.network(channel);
        let (layers, weights) = (network.layers, network.weights);
        let values = inputs.values_of(channel);
        let sums = dispatch(GradientsOfChannel { network, values, upstream, of_values, width: inputs.width });
        write_gradients(layers, &weights, &sums, inputs.parameters_of(channel), gradients);
    });
    [of_values, of_parameters]
}

/// Inputs of the CPU back ends.
#[derive(Clone, Debug)]
pub struct CpuInputs {
    inputs: [HostTensor; INPUTS],
    shape: DensityShape,
    width: f32,
}

impl CpuInputs {
    fn slices(&self) -> DensitySlices<'_> {
        let [values, parameters] = self.inputs.each_ref().map(HostTensor::as_slice);
        DensitySlices { values, parameters, shape: &self.shape, width: self.width }
    }
}

fn forward_on_cpu<B: HostBackend>(
    tensors: DensityTensors<B>,
    shape: DensityShape,
    width: f32,
) -> (FloatTensor<B>, CpuInputs) {
    let inputs = CpuInputs { inputs: tensors.into_array().map(B::to_host), shape, width };
    let slices = inputs.slices();
    let likelihoods = B::from_values(likelihoods_of_slices(&slices), [slices.channels(), slices.count()]);
    (likelihoods, inputs)
}

fn backward_on_cpu<B: HostBackend>(inputs: &CpuInputs, gradient: FloatTensor<B>) -> DensityTensors<B> {
    let slices = inputs.slices();
    let upstream = B::to_host(gradient);
    let [of_values, of_parameters] = gradients_of_slices(&slices, upstream.as_slice());
    DensityTensors {
        values: B::from_values(of_values, [slices.channels(), slices.count()]),
        parameters: B::from_values(of_parameters, [slices.channels(), slices.shape.parameters()]),
    }
}

for_cpu_back_ends! {
    DensityLikelihoodKernels {
        type Inputs = CpuInputs;

        fn density_likelihood_forward(
            tensors: DensityTensors<Self>,
            shape: DensityShape,
            width: f32,
        ) -> (FloatTensor<Self>, CpuInputs) {
            forward_on_cpu(tensors, shape, width)
        }

        fn density_likelihood_backward(inputs: CpuInputs, gradient: FloatTensor<Self>) -> DensityTensors<Self> {
            backward_on_cpu(&inputs, gradient)
        }
    }
}
