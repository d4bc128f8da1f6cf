//! The deformation network on a CPU, block by block.
//!
//! A block is [`ROWS`] rows. Its numbers are stored channel by channel, `[channel][ROWS]`, so that vectors hold rows: a weight is
//! a factor for all lanes, and no layer's width need be a multiple of a vector's.
//!
//! Gradients of the parameters are summed within chunks of blocks, whose number depends on that of the rows only; then the
//! chunks are summed in order. So the result is the same for any number of threads.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::{LayerLayout, NetworkGradients, NetworkKernels, NetworkLayout, NetworkTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// Rows of a block: the numbers of all layers of 64 channels fit the second-level cache.
const ROWS: usize = 128;
/// Vectors of rows of a tile.
const VECTORS: usize = 2;
/// Channels of a tile: as many sums as registers hold.
const CHANNELS: usize = 6;
/// Most chunks, each of which has its own sums.
const CHUNKS: usize = 32;

/// A layer's parameters.
#[derive(Debug)]
struct Layer {
    layout: LayerLayout,
    is_hidden: bool,
    /// `[inputs][outputs]`
    weight: HostTensor,
    /// `[outputs][inputs]`
    transposed: Vec<f32>,
    bias: HostTensor,
}

/// A network's parameters.
#[derive(Debug)]
struct Network {
    layers: Vec<Layer>,
    layout: NetworkLayout,
}

impl Network {
    fn new(layout: NetworkLayout, parameters: Vec<HostTensor>) -> Self {
        let mut parameters = parameters.into_iter();
        let mut next = || parameters.next().expect("two tensors a layer");
        let layers = layout.layers().iter().enumerate().map(|(number, &layer)| {
            let [weight, bias] = [next(), next()];
            let transposed = transposed(weight.as_slice(), layer.outputs);
            Layer { layout: layer, is_hidden: layout.is_hidden(number), weight, transposed, bias }
        });
        Self { layers: layers.collect(), layout }
    }

    /// The outputs of all layers for a block of features; of hidden layers after their ReLU.
    #[inline(always)]
    fn forward<L: Lanes>(&self, features: &[f32], outputs: &mut [Vec<f32>]) {
        for (number, layer) in self.layers.iter().enumerate() {
            let (before, own) = outputs.split_at_mut(number);
            let input = layer.layout.input.map_or(features, |input| &before[input]);
            product::<L>(input, layer.weight.as_slice(), Some(layer.bias.as_slice()), layer.is_hidden, &mut own[0]);
        }
    }

    /// Memory for the outputs, or the gradients, of all layers.
    fn block(&self) -> Vec<Vec<f32>> {
        self.layers.iter().map(|layer| vec![0.0; layer.layout.outputs * ROWS]).collect()
    }
}

fn transposed(matrix: &[f32], columns: usize) -> Vec<f32> {
    (0..columns).flat_map(|column| matrix.iter().skip(column).step_by(columns).copied()).collect()
}

/// `out[c] = bias[c] + Σ over k of weight[k][c] input[k]`, where `input [inputs][ROWS]` and `out [outputs][ROWS]`. Without biases,
/// adds to `out`.
#[inline(always)]
fn product<L: Lanes>(input: &[f32], weight: &[f32], bias: Option<&[f32]>, rectify: bool, out: &mut [f32]) {
    let outputs = out.len() / ROWS;
    let mut first = 0;
    while first + CHANNELS <= outputs {
        channels::<L, CHANNELS>(input, weight, bias, rectify, first, out);
        first += CHANNELS;
    }
    match outputs - first {
        1 => channels::<L, 1>(input, weight, bias, rectify, first, out),
        2 => channels::<L, 2>(input, weight, bias, rectify, first, out),
        3 => channels::<L, 3>(input, weight, bias, rectify, first, out),
        4 => channels::<L, 4>(input, weight, bias, rectify, first, out),
        5 => channels::<L, 5>(input, weight, bias, rectify, first, out),
        _ => {}
    }
}

/// [`product`], for channels `first..first + C`.
#[inline(always)]
fn channels<L: Lanes, const C: usize>(
    input: &[f32],
    weight: &[f32],
    bias: Option<&[f32]>,
    rectify: bool,
    first: usize,
    out: &mut [f32],
) {
    let outputs = out.len() / ROWS;
    for row in (0..ROWS).step_by(VECTORS * LANES) {
        let mut sums = [[L::splat(0.0); VECTORS]; C];
        for c in 0..C {
            let out = &out[(first + c) * ROWS + row..][..VECTORS * LANES];
            for v in 0..VECTORS {
                sums[c][v] = match bias {
                    Some(bias) => L::splat(bias[first + c]),
                    None => L::load(vector(&out[v * LANES..])),
                };
            }
        }
        for (input, weight) in input.chunks_exact(ROWS).zip(weight.chunks_exact(outputs)) {
            let input = &input[row..row + VECTORS * LANES];
            let weight = &weight[first..first + C];
            let mut rows = [L::splat(0.0); VECTORS];
            for v in 0..VECTORS {
                rows[v] = L::load(vector(&input[v * LANES..]));
            }
            for c in 0..C {
                let weight = L::splat(weight[c]);
                for v in 0..VECTORS {
                    sums[c][v] = rows[v].mul_add(weight, sums[c][v]);
                }
            }
        }
        for c in 0..C {
            let out = &mut out[(first + c) * ROWS + row..][..VECTORS * LANES];
            for v in 0..VECTORS {
                let sum = if rectify { sums[c][v].max(L::splat(0.0)) } else { sums[c][v] };
                sum.store(vector_mut(&mut out[v * LANES..]));
            }
        }
    }
}

/// Adds `Σ over rows of input[k] gradient[c]` to `weight[k][c]`.
#[inline(always)]
fn add_weight_gradient<L: Lanes>(input: &[f32], gradient: &[f32], weight: &mut [f32]) {
    const PAIRS: usize = LANES / 2;
    let [inputs, outputs] = [input.len() / ROWS, gradient.len() / ROWS];
    let mut k = 0;
    while k + PAIRS <= inputs {
        let mut c = 0;
        while c + 2 <= outputs {
            let mut sums = [L::splat(0.0); LANES];
            let (first, second) = (&gradient[c * ROWS..][..ROWS], &gradient[(c + 1) * ROWS..][..ROWS]);
            let rows: [&[f32]; PAIRS] = std::array::from_fn(|j| &input[(k + j) * ROWS..][..ROWS]);
            for row in (0..ROWS).step_by(LANES) {
                let first = L::load(vector(&first[row..]));
                let second = L::load(vector(&second[row..]));
                for j in 0..PAIRS {
                    let input = L::load(vector(&rows[j][row..]));
                    sums[2 * j] = input.mul_add(first, sums[2 * j]);
                    sums[2 * j + 1] = input.mul_add(second, sums[2 * j + 1]);
                }
            }
            let sums = L::sums(&sums);
            for j in 0..PAIRS {
                weight[(k + j) * outputs + c] += sums[2 * j];
                weight[(k + j) * outputs + c + 1] += sums[2 * j + 1];
            }
            c += 2;
        }
        for j in 0..PAIRS {
            for c in c..outputs {
                weight[(k + j) * outputs + c] += dot::<L>(&input[(k + j) * ROWS..], &gradient[c * ROWS..]);
            }
        }
        k += PAIRS;
    }
    for k in k..inputs {
        for c in 0..outputs {
            weight[k * outputs + c] += dot::<L>(&input[k * ROWS..], &gradient[c * ROWS..]);
        }
    }
}

/// The product of two channels, summed over the rows.
#[inline(always)]
fn dot<L: Lanes>(a: &[f32], b: &[f32]) -> f32 {
    let mut sum = L::splat(0.0);
    for row in (0..ROWS).step_by(LANES) {
        sum = L::load(vector(&a[row..])).mul_add(L::load(vector(&b[row..])), sum);
    }
    sum.sum()
}

#[inline(always)]
fn vector(values: &[f32]) -> &[f32; LANES] {
    values.first_chunk().expect("blocks are whole vectors")
}

#[inline(always)]
fn vector_mut(values: &mut [f32]) -> &mut [f32; LANES] {
    values.first_chunk_mut().expect("blocks are whole vectors")
}

/// Some rows as a block `[width][ROWS]`; rows that are missing are zeros.
fn gather(rows: &[f32], width: usize, block: &mut [f32]) {
    let count = rows.len() / width;
    for (row, values) in rows.chunks_exact(width).enumerate() {
        for (channel, value) in values.iter().enumerate() {
            block[channel * ROWS + row] = *value;
        }
    }
    for channel in block.chunks_exact_mut(ROWS) {
        channel[count..].fill(0.0);
    }
}

/// The inverse of [`gather`], into columns `first..` of rows of `width` numbers.
fn scatter(block: &[f32], rows: &mut [f32], width: usize, first: usize) {
    for (row, values) in rows.chunks_exact_mut(width).enumerate() {
        for (value, channel) in values[first..].iter_mut().zip(block.chunks_exact(ROWS)) {
            *value = channel[row];
        }
    }
}

/// The forward pass of a chunk.
struct Forward<'a> {
    network: &'a Network,
    features: &'a [f32],
    out: &'a mut [f32],
}

impl LaneKernel for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let width = self.network.layout.features();
        let (places, outputs) = self.network.layout.places();
        let mut features = vec![0.0; width * ROWS];
        let mut blocks = self.network.block();
        for (rows, out) in self.features.chunks(ROWS * width).zip(self.out.chunks_mut(ROWS * outputs)) {
            gather(rows, width, &mut features);
            self.network.forward::<L>(&features, &mut blocks);
            for (block, place) in blocks.iter().zip(&places) {
                if let Some(first) = *place {
                    scatter(block, out, outputs, first);
                }
            }
        }
    }
}

/// The backward pass of a chunk.
struct Backward<'a> {
    network: &'a Network,
    features: &'a [f32],
    upstream: &'a [f32],
    /// Empty if not requested.
    of_features: &'a mut [f32],
}

/// Gradients of a layer's weights and biases.
type LayerGradients = [Vec<f32>; 2];

impl LaneKernel for Backward<'_> {
    type Output = Vec<LayerGradients>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { network, .. } = self;
        let width = network.layout.features();
        let (places, outputs) = network.layout.places();
        let mut features = vec![0.0; width * ROWS];
        let mut of_features = if self.of_features.is_empty() { Vec::new() } else { features.clone() };
        let mut blocks = network.block();
        let mut gradients = network.block();
        let mut upstream = vec![0.0; outputs * ROWS];
        let mut of_features_rows = self.of_features.chunks_mut(ROWS * width);
        let zeros = |layer: &Layer| {
            let LayerLayout { inputs, outputs, .. } = layer.layout;
            [vec![0.0; inputs * outputs], vec![0.0; outputs]]
        };
        let mut sums: Vec<LayerGradients> = network.layers.iter().map(zeros).collect();
        for (rows, upstream_rows) in self.features.chunks(ROWS * width).zip(self.upstream.chunks(ROWS * outputs)) {
            gather(rows, width, &mut features);
            gather(upstream_rows, outputs, &mut upstream);
            network.forward::<L>(&features, &mut blocks);
            for (gradient, place) in gradients.iter_mut().zip(&places) {
                match *place {
                    Some(first) => {
                        let length = gradient.len();
                        gradient.copy_from_slice(&upstream[first * ROWS..][..length]);
                    }
                    None => gradient.fill(0.0),
                }
            }
            of_features.fill(0.0);
            for (number, layer) in network.layers.iter().enumerate().rev() {
                let (before, own) = gradients.split_at_mut(number);
                let gradient = &mut own[0];
                if layer.is_hidden {
                    rectify::<L>(&blocks[number], gradient);
                }
                let [weight, bias] = &mut sums[number];
                let input = layer.layout.input.map_or(&features, |input| &blocks[input]);
                add_weight_gradient::<L>(input, gradient, weight);
                for (bias, channel) in bias.iter_mut().zip(gradient.chunks_exact(ROWS)) {
                    *bias += total::<L>(channel);
                }
                let of_input = match layer.layout.input {
                    Some(input) => &mut before[input],
                    None => &mut of_features,
                };
                if !of_input.is_empty() {
                    product::<L>(gradient, &layer.transposed, None, false, of_input);
                }
            }
            if let Some(rows) = of_features_rows.next() {
                scatter(&of_features, rows, width, 0);
            }
        }
        sums
    }
}

/// Sets a gradient to 0 where a ReLU gave 0.
#[inline(always)]
fn rectify<L: Lanes>(output: &[f32], gradient: &mut [f32]) {
    for (output, gradient) in output.chunks_exact(LANES).zip(gradient.chunks_exact_mut(LANES)) {
        // The smallest positive number: a ReLU gives 0 or more.
        let is_positive = L::load(vector(output)).at_least(L::splat(f32::from_bits(1)));
        is_positive.and(L::load(vector(gradient))).store(vector_mut(gradient));
    }
}

/// The sum of a channel.
#[inline(always)]
fn total<L: Lanes>(channel: &[f32]) -> f32 {
    let mut sum = L::splat(0.0);
    for values in channel.chunks_exact(LANES) {
        sum = sum.add(L::load(vector(values)));
    }
    sum.sum()
}

/// Rows of a chunk for this number of rows.
fn rows_of_chunk(rows: usize) -> usize {
    rows.div_ceil(ROWS).div_ceil(CHUNKS).max(1) * ROWS
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuNetwork {
    features: HostTensor,
    network: Arc<Network>,
}

fn forward_on_cpu<B: HostBackend>(tensors: NetworkTensors<B>, layout: NetworkLayout) -> (FloatTensor<B>, CpuNetwork) {
    let count = tensors.features.shape()[0];
    let features = B::to_host(tensors.features);
    let network = Network::new(layout, tensors.parameters.0.into_iter().map(B::to_host).collect());
    let (_, outputs) = network.layout.places();
    let chunk = rows_of_chunk(count);
    let mut out = vec![0.0; count * outputs];
    out.par_chunks_mut(chunk * outputs)
        .zip(features.as_slice().par_chunks(chunk * network.layout.features()))
        .for_each(|(out, features)| dispatch(Forward { network: &network, features, out }));
    (B::from_values(out, [count, outputs]), CpuNetwork { features, network: Arc::new(network) })
}

fn backward_on_cpu<B: HostBackend>(
    saved: CpuNetwork,
    gradient: FloatTensor<B>,
    with_features: bool,
) -> NetworkGradients<B> {
    let CpuNetwork { features, network } = saved;
    let (rows, width) = (features.as_slice(), network.layout.features());
    let (_, outputs) = network.layout.places();
    let count = rows.len() / width;
    let chunk = rows_of_chunk(count);
    let upstream = B::to_host(gradient);
    let mut of_features = vec![0.0; if with_features { rows.len() } else { 0 }];
    // An empty piece for each chunk where the features' gradient is not requested.
    let mut pieces: Vec<&mut [f32]> = of_features.chunks_mut(chunk * width).collect();
    pieces.resize_with(count.div_ceil(chunk), Default::default);
    let chunks = (rows.par_chunks(chunk * width), upstream.as_slice().par_chunks(chunk * outputs), pieces);
    let mut sums: Vec<Vec<LayerGradients>> = chunks
        .into_par_iter()
        .map(|(features, upstream, of_features)| {
            dispatch(Backward { network: &network, features, upstream, of_features })
        })
        .collect();
    let (first, others) = sums.split_first_mut().expect("at least one row");
    for other in others {
        for (to, from) in first.iter_mut().flatten().flatten().zip(other.iter().flatten().flatten()) {
            *to += from;
        }
    }
    let parameters = std::mem::take(first).into_iter().zip(&network.layers).flat_map(|([weight, bias], layer)| {
        let LayerLayout { inputs, outputs, .. } = layer.layout;
        [B::from_values(weight, [inputs, outputs]), B::from_values(bias, [outputs])]
    });
    NetworkGradients {
        features: with_features.then(|| B::from_values(of_features, [count, width])),
        parameters: parameters.collect(),
    }
}

for_cpu_back_ends! {
    NetworkKernels {
        type Saved = CpuNetwork;

        fn network_forward(tensors: NetworkTensors<Self>, layout: NetworkLayout) -> (FloatTensor<Self>, CpuNetwork) {
            forward_on_cpu(tensors, layout)
        }

        fn network_backward(
            saved: CpuNetwork,
            gradient: FloatTensor<Self>,
            with_features: bool,
        ) -> NetworkGradients<Self> {
            backward_on_cpu(saved, gradient, with_features)
        }
    }
}
