//! The deformation network on a CPU, block by block.
//!
//! A block is [`ROWS`] rows. Its numbers are stored channel by channel, `[channel][STRIDE]`, so that vectors hold rows: a weight is
//! a factor for all lanes, and no layer's width need be a multiple of a vector's. The outputs of the hidden layers are kept in
//! this form for the backward pass: to compute them again takes longer than to read them.
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
/// Numbers from one channel of a block to the next: an odd number of cache lines, so that channels do not displace each other.
const STRIDE: usize = ROWS + 16;
/// Vectors of rows of a tile.
const VECTORS: usize = 2;
/// Channels of a tile: as many sums as registers hold.
const CHANNELS: usize = 6;
/// Most chunks, each of which has its own sums.
const CHUNKS: usize = 32;

/// A layer's parameters, and where its output is.
#[derive(Debug)]
struct Layer {
    layout: LayerLayout,
    /// `[inputs][outputs]`
    weight: HostTensor,
    /// `[outputs][inputs]`
    transposed: Vec<f32>,
    bias: HostTensor,
    place: Place,
}

/// The first channel of a layer's output.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Among those of the hidden layers.
    Hidden(usize),
    /// Among those of the network.
    Output(usize),
}

/// A network's parameters.
#[derive(Debug)]
struct Network {
    layers: Vec<Layer>,
    /// Channels of the features, of all hidden layers, and of the network's output.
    features: usize,
    hidden: usize,
    outputs: usize,
}

impl Network {
    fn new(layout: &NetworkLayout, parameters: Vec<HostTensor>) -> Self {
        let mut parameters = parameters.into_iter();
        let mut next = || parameters.next().expect("two tensors a layer");
        let (places, outputs) = layout.places();
        let mut hidden = 0;
        let layers = layout.layers().iter().zip(places).map(|(&layer, place)| {
            let [weight, bias] = [next(), next()];
            let transposed = transposed(weight.as_slice(), layer.outputs);
            let place = place.map_or_else(
                || {
                    hidden += layer.outputs;
                    Place::Hidden(hidden - layer.outputs)
                },
                Place::Output,
            );
            Layer { layout: layer, weight, transposed, bias, place }
        });
        let layers = layers.collect();
        Self { layers, features: layout.features(), hidden, outputs }
    }

    /// The channels that a layer reads, in a block of features or in one of hidden layers.
    fn input<'a>(&self, layer: &Layer, features: &'a [f32], hidden: &'a [f32]) -> &'a [f32] {
        match layer.layout.input.map(|input| self.layers[input].place) {
            Some(Place::Hidden(first)) => channels(hidden, first, layer.layout.inputs),
            _ => features,
        }
    }

    /// The outputs of all layers for a block of features; of hidden layers after their ReLU.
    #[inline(always)]
    fn forward<L: Lanes>(&self, features: &[f32], hidden: &mut [f32], outputs: &mut [f32]) {
        for layer in &self.layers {
            let (weight, bias) = (layer.weight.as_slice(), Some(layer.bias.as_slice()));
            match layer.place {
                Place::Hidden(first) => {
                    // A layer comes after the one that it reads.
                    let (before, own) = hidden.split_at_mut(first * STRIDE);
                    let own = &mut own[..layer.layout.outputs * STRIDE];
                    product::<L>(self.input(layer, features, before), weight, bias, true, own);
                }
                Place::Output(first) => {
                    let own = &mut outputs[first * STRIDE..][..layer.layout.outputs * STRIDE];
                    product::<L>(self.input(layer, features, hidden), weight, bias, false, own);
                }
            }
        }
    }
}

/// Some channels of a block.
fn channels(block: &[f32], first: usize, count: usize) -> &[f32] {
    &block[first * STRIDE..][..count * STRIDE]
}

fn transposed(matrix: &[f32], columns: usize) -> Vec<f32> {
    (0..columns).flat_map(|column| matrix.iter().skip(column).step_by(columns).copied()).collect()
}

/// `out[c] = bias[c] + Σ over k of weight[k][c] input[k]`, where `input [inputs][STRIDE]` and `out [outputs][STRIDE]`. Without biases,
/// adds to `out`.
#[inline(always)]
fn product<L: Lanes>(input: &[f32], weight: &[f32], bias: Option<&[f32]>, rectify: bool, out: &mut [f32]) {
    let outputs = out.len() / STRIDE;
    for row in (0..ROWS).step_by(VECTORS * LANES) {
        let mut first = 0;
        while first + CHANNELS <= outputs {
            tile::<L, CHANNELS>(input, weight, bias, rectify, [row, first], out);
            first += CHANNELS;
        }
        match outputs - first {
            1 => tile::<L, 1>(input, weight, bias, rectify, [row, first], out),
            2 => tile::<L, 2>(input, weight, bias, rectify, [row, first], out),
            3 => tile::<L, 3>(input, weight, bias, rectify, [row, first], out),
            4 => tile::<L, 4>(input, weight, bias, rectify, [row, first], out),
            5 => tile::<L, 5>(input, weight, bias, rectify, [row, first], out),
            _ => {}
        }
    }
}

/// [`product`], for `C` channels from `first` on, and [`VECTORS`] vectors of rows from `row` on.
#[inline(always)]
fn tile<L: Lanes, const C: usize>(
    input: &[f32],
    weight: &[f32],
    bias: Option<&[f32]>,
    rectify: bool,
    [row, first]: [usize; 2],
    out: &mut [f32],
) {
    let outputs = out.len() / STRIDE;
    let mut sums = [[L::splat(0.0); VECTORS]; C];
    for c in 0..C {
        let out = &out[(first + c) * STRIDE + row..][..VECTORS * LANES];
        for v in 0..VECTORS {
            sums[c][v] = match bias {
                Some(bias) => L::splat(bias[first + c]),
                None => L::load(vector(&out[v * LANES..])),
            };
        }
    }
    for (input, weight) in input.chunks_exact(STRIDE).zip(weight.chunks_exact(outputs)) {
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
        let out = &mut out[(first + c) * STRIDE + row..][..VECTORS * LANES];
        for v in 0..VECTORS {
            let sum = if rectify { sums[c][v].max(L::splat(0.0)) } else { sums[c][v] };
            sum.store(vector_mut(&mut out[v * LANES..]));
        }
    }
}

/// Adds `Σ over rows of input[k] gradient[c]` to `weight[k][c]`.
#[inline(always)]
fn add_weight_gradient<L: Lanes>(input: &[f32], gradient: &[f32], weight: &mut [f32]) {
    const PAIRS: usize = LANES / 2;
    let [inputs, outputs] = [input.len() / STRIDE, gradient.len() / STRIDE];
    let mut k = 0;
    while k + PAIRS <= inputs {
        let mut c = 0;
        while c + 2 <= outputs {
            let mut sums = [L::splat(0.0); LANES];
            let (first, second) = (&gradient[c * STRIDE..][..ROWS], &gradient[(c + 1) * STRIDE..][..ROWS]);
            let rows: [&[f32]; PAIRS] = std::array::from_fn(|j| &input[(k + j) * STRIDE..][..ROWS]);
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
                weight[(k + j) * outputs + c] += dot::<L>(&input[(k + j) * STRIDE..], &gradient[c * STRIDE..]);
            }
        }
        k += PAIRS;
    }
    for k in k..inputs {
        for c in 0..outputs {
            weight[k * outputs + c] += dot::<L>(&input[k * STRIDE..], &gradient[c * STRIDE..]);
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

/// Some rows as a block `[width][STRIDE]`; rows that are missing are zeros.
fn gather(rows: &[f32], width: usize, block: &mut [f32]) {
    let count = rows.len() / width;
    for (row, values) in rows.chunks_exact(width).enumerate() {
        for (channel, value) in block.chunks_exact_mut(STRIDE).zip(values) {
            channel[row] = *value;
        }
    }
    for channel in block.chunks_exact_mut(STRIDE) {
        channel[count..].fill(0.0);
    }
}

/// The inverse of [`gather`].
fn scatter(block: &[f32], rows: &mut [f32], width: usize) {
    for (row, values) in rows.chunks_exact_mut(width).enumerate() {
        for (value, channel) in values.iter_mut().zip(block.chunks_exact(STRIDE)) {
            *value = channel[row];
        }
    }
}

/// The forward pass of a chunk.
struct Forward<'a> {
    network: &'a Network,
    features: &'a [f32],
    out: &'a mut [f32],
    /// The hidden layers of each block; empty if they are not kept.
    hidden: &'a mut [f32],
}

impl LaneKernel for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { network, .. } = self;
        let [mut features, mut outputs, mut passing] =
            [network.features, network.outputs, network.hidden].map(|channels| vec![0.0; channels * STRIDE]);
        let mut kept = self.hidden.chunks_exact_mut((network.hidden * STRIDE).max(1));
        let rows = self.features.chunks(ROWS * network.features).zip(self.out.chunks_mut(ROWS * network.outputs));
        for (rows, out) in rows {
            gather(rows, network.features, &mut features);
            network.forward::<L>(&features, kept.next().unwrap_or(&mut passing), &mut outputs);
            scatter(&outputs, out, network.outputs);
        }
    }
}

/// The backward pass of a chunk.
struct Backward<'a> {
    network: &'a Network,
    features: &'a [f32],
    hidden: &'a [f32],
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
        let with_features = !self.of_features.is_empty();
        let [mut features, mut of_features, mut upstream, mut of_hidden] =
            [network.features, network.features, network.outputs, network.hidden]
                .map(|channels| vec![0.0; channels * STRIDE]);
        let mut kept = self.hidden.chunks_exact((network.hidden * STRIDE).max(1));
        let mut rows_of_features = self.of_features.chunks_mut(ROWS * network.features);
        let zeros = |layer: &Layer| {
            let LayerLayout { inputs, outputs, .. } = layer.layout;
            [vec![0.0; inputs * outputs], vec![0.0; outputs]]
        };
        let mut sums: Vec<LayerGradients> = network.layers.iter().map(zeros).collect();
        let rows = self.features.chunks(ROWS * network.features).zip(self.upstream.chunks(ROWS * network.outputs));
        for (rows, upstream_rows) in rows {
            gather(rows, network.features, &mut features);
            gather(upstream_rows, network.outputs, &mut upstream);
            let hidden = kept.next().unwrap_or_default();
            of_features.fill(0.0);
            of_hidden.fill(0.0);
            for (layer, [of_weight, of_bias]) in network.layers.iter().zip(&mut sums).rev() {
                let outputs = layer.layout.outputs;
                let (before, gradient) = match layer.place {
                    Place::Hidden(first) => {
                        let (before, own) = of_hidden.split_at_mut(first * STRIDE);
                        let own = &mut own[..outputs * STRIDE];
                        rectify::<L>(channels(hidden, first, outputs), own);
                        (before, &*own)
                    }
                    Place::Output(first) => (&mut of_hidden[..], channels(&upstream, first, outputs)),
                };
                add_weight_gradient::<L>(network.input(layer, &features, hidden), gradient, of_weight);
                for (bias, channel) in of_bias.iter_mut().zip(gradient.chunks_exact(STRIDE)) {
                    *bias += total::<L>(&channel[..ROWS]);
                }
                match layer.layout.input.map(|input| network.layers[input].place) {
                    Some(Place::Hidden(first)) => {
                        let of_input = &mut before[first * STRIDE..][..layer.layout.inputs * STRIDE];
                        product::<L>(gradient, &layer.transposed, None, false, of_input);
                    }
                    _ if with_features => product::<L>(gradient, &layer.transposed, None, false, &mut of_features),
                    _ => {}
                }
            }
            if let Some(rows) = rows_of_features.next() {
                scatter(&of_features, rows, network.features);
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

/// Blocks of a chunk for this number of rows.
fn blocks_of_chunk(rows: usize) -> usize {
    rows.div_ceil(ROWS).div_ceil(CHUNKS).max(1)
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuNetwork {
    features: HostTensor,
    network: Arc<Network>,
    /// `[blocks][hidden channels][STRIDE]`, after their ReLU.
    hidden: Arc<Vec<f32>>,
}

/// Pieces of this length, or as many empty ones as there are chunks.
fn pieces(values: &mut [f32], length: usize, chunks: usize) -> Vec<&mut [f32]> {
    let mut pieces: Vec<&mut [f32]> = values.chunks_mut(length.max(1)).collect();
    pieces.resize_with(chunks, Default::default);
    pieces
}

fn forward_on_cpu<B: HostBackend>(
    tensors: NetworkTensors<B>,
    layout: &NetworkLayout,
    keep: bool,
) -> (FloatTensor<B>, CpuNetwork) {
    let count = tensors.features.shape()[0];
    let features = B::to_host(tensors.features);
    let network = Network::new(layout, tensors.parameters.0.into_iter().map(B::to_host).collect());
    let blocks = blocks_of_chunk(count);
    let chunk = blocks * ROWS;
    let of_block = network.hidden * STRIDE;
    let mut hidden = vec![0.0; if keep { count.div_ceil(ROWS) * of_block } else { 0 }];
    let mut out = vec![0.0; count * network.outputs];
    let kept = pieces(&mut hidden, blocks * of_block, count.div_ceil(chunk));
    let rows = (out.par_chunks_mut(chunk * network.outputs), features.as_slice().par_chunks(chunk * network.features));
    rows.into_par_iter().zip(kept).for_each(|((out, features), hidden)| {
        dispatch(Forward { network: &network, features, out, hidden });
    });
    let outputs = B::from_values(out, [count, network.outputs]);
    (outputs, CpuNetwork { features, network: Arc::new(network), hidden: Arc::new(hidden) })
}

fn backward_on_cpu<B: HostBackend>(
    saved: CpuNetwork,
    gradient: FloatTensor<B>,
    with_features: bool,
) -> NetworkGradients<B> {
    let CpuNetwork { features, network, hidden } = saved;
    let rows = features.as_slice();
    let count = rows.len() / network.features;
    let blocks = blocks_of_chunk(count);
    let chunk = blocks * ROWS;
    let upstream = B::to_host(gradient);
    let mut of_features = vec![0.0; if with_features { rows.len() } else { 0 }];
    let of_features_rows = pieces(&mut of_features, chunk * network.features, count.div_ceil(chunk));
    let of_chunk = blocks * network.hidden * STRIDE;
    let chunks = (rows.par_chunks(chunk * network.features), upstream.as_slice().par_chunks(chunk * network.outputs));
    let sums =
        chunks.into_par_iter().zip(of_features_rows).enumerate().map(|(k, ((features, upstream), of_features))| {
            let end = hidden.len().min((k + 1) * of_chunk);
            let hidden = &hidden[k * of_chunk..end];
            dispatch(Backward { network: &network, features, hidden, upstream, of_features })
        });
    let mut sums: Vec<Vec<LayerGradients>> = sums.collect();
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
        features: with_features.then(|| B::from_values(of_features, [count, network.features])),
        parameters: parameters.collect(),
    }
}

for_cpu_back_ends! {
    NetworkKernels {
        type Saved = CpuNetwork;

        fn network_forward(
            tensors: NetworkTensors<Self>,
            layout: NetworkLayout,
            keep: bool,
        ) -> (FloatTensor<Self>, CpuNetwork) {
            forward_on_cpu(tensors, &layout, keep)
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
