//! The deformation network on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{NETWORK_BACKWARD, NETWORK_FORWARD, NETWORK_GATHER, NETWORK_WEIGHTS, Shader};

use super::{
    LayerLayout, MOST_CHANNELS, MOST_LAYERS, NetworkGradients, NetworkKernels, NetworkLayout, NetworkTensors, network,
};
use crate::gpu::{Arena, Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::tensor_list::TensorList;

/// Numbers of a workgroup's memory in `network_forward` and `network_backward`.
const MEMORY: usize = 4096;
/// Rows of a workgroup: more, where the network is narrow enough.
const ROWS: [usize; 2] = [16, 8];
/// `SIDE` in `network_weights`.
const SIDE: usize = 32;
/// Least rows of a part in `network_weights`, and most parts.
const PART: usize = 256;
const MOST_PARTS: usize = 128;
/// `FEATURES` in `network_weights`.
const FEATURES: u32 = u32::MAX;

const _: () = assert!(MOST_CHANNELS * ROWS[1] == MEMORY);

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "deformation_network", kernels, samples: &[trunk_and_heads, wide] };

fn kernels() -> Vec<Kernel> {
    let by_rows =
        [NETWORK_FORWARD, NETWORK_BACKWARD].into_iter().flat_map(|shader| ROWS.map(|rows| with_rows(shader, rows)));
    [NETWORK_GATHER.into(), weights_kernel()].into_iter().chain(by_rows).collect()
}

fn with_rows(shader: Shader, rows: usize) -> Kernel {
    Kernel::new(shader).constant("ROWS", rows as u32)
}

/// `ROWS` means nothing there, but the description of a network needs it.
fn weights_kernel() -> Kernel {
    with_rows(NETWORK_WEIGHTS, ROWS[0])
}

/// A network whose parameters are in one buffer.
#[derive(Clone, Debug)]
struct PackedNetwork {
    layout: NetworkLayout,
    parameters: Arena,
    rows: usize,
}

/// What a kernel gets besides the sizes that all of them need.
struct Description {
    extra: [usize; 2],
    places: Vec<[u32; 4]>,
}

impl PackedNetwork {
    fn new(gpu: &Gpu, layout: NetworkLayout, parameters: Vec<CubeTensor>, rows: usize) -> Result<Self, GpuError> {
        let lengths: Vec<usize> = parameters.iter().map(|parameter| parameter.shape().num_elements()).collect();
        let tensors: Vec<Handle> = parameters.into_iter().map(buffer_of).collect();
        let parameters = Arena::of(gpu, "parameters of a network", &tensors, &lengths)?;
        Ok(Self { layout, parameters, rows })
    }

    fn rows_of_group(&self) -> usize {
        let channels = self.layout.channels_at_once();
        ROWS.into_iter().find(|rows| rows * channels <= MEMORY).expect("as `fits` has checked")
    }

    fn layers(&self) -> impl Iterator<Item = (usize, &LayerLayout)> {
        self.layout.layers().iter().enumerate()
    }

    /// Numbers in a row of the outputs of all hidden layers.
    fn hidden(&self) -> usize {
        let hidden = self.layers().filter(|(number, _)| self.layout.is_hidden(*number));
        hidden.map(|(_, layer)| layer.outputs).sum()
    }

    /// For each layer, the first column of its output in those of the hidden layers, or in the network's.
    fn columns(&self) -> Vec<usize> {
        let (outputs, _) = self.layout.places();
        let mut hidden = 0;
        let columns = self.layers().map(|(number, layer)| {
            outputs[number].unwrap_or_else(|| {
                hidden += layer.outputs;
                hidden - layer.outputs
            })
        });
        columns.collect()
    }

    /// The words of `Network` in the shaders.
    fn uniform(&self, description: &Description) -> Vec<u32> {
        let (_, outputs) = self.layout.places();
        let [first, second] = description.extra;
        let counts =
            [self.rows, self.layout.features(), outputs, self.hidden(), self.layout.layers().len(), first, second, 0];
        let mut words: Vec<u32> = counts.iter().map(|count| *count as u32).collect();
        for (number, layer) in self.layers() {
            let [weight, bias] = [0, 1].map(|k| self.parameters.places.starts[2 * number + k]);
            words.extend([layer.inputs, layer.outputs, weight, bias].map(|size| size as u32));
        }
        let gap = 4 * (MOST_LAYERS - self.layout.layers().len());
        words.resize(words.len() + gap, 0);
        words.extend(description.places.iter().flatten());
        words.resize(words.len() + gap, 0);
        words
    }
}

fn forward(
    tensors: NetworkTensors<CubeBackend>,
    layout: NetworkLayout,
    keep: bool,
) -> Result<(CubeTensor, SavedNetwork), GpuError> {
    let gpu = Gpu::of(&tensors.features)?;
    let rows = tensors.features.shape()[0];
    let packed = PackedNetwork::new(&gpu, layout, tensors.parameters.0, rows)?;
    let features = buffer_of(tensors.features);
    let (_, width) = packed.layout.places();
    let outputs = gpu.allocate("outputs of a network", rows * width)?;
    let hidden = gpu.allocate("hidden layers of a network", if keep { rows * packed.hidden() } else { 0 })?;
    let slots = packed.layout.forward_slots();
    let columns = packed.columns();
    let places = packed.layers().map(|(number, layer)| {
        let input = layer.input.map_or(slots.features, |input| slots.layers[input]);
        let is_hidden = usize::from(packed.layout.is_hidden(number));
        [input, slots.layers[number], columns[number], is_hidden].map(|place| place as u32)
    });
    let uniform = packed.uniform(&Description { extra: [usize::from(keep), 0], places: places.collect() });
    Launch::new(&gpu.client, with_rows(NETWORK_FORWARD, packed.rows_of_group()))
        .reads(&features)
        .reads(&packed.parameters.buffer)
        .writes(&outputs)
        .writes(&hidden)
        .uniform(&uniform)
        .groups(rows.div_ceil(packed.rows_of_group()))?;
    let outputs = gpu.tensor(first_words(&outputs, rows * width), Shape::from([rows, width]));
    Ok((outputs, SavedNetwork { packed, features, hidden }))
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct SavedNetwork {
    packed: PackedNetwork,
    features: Handle,
    /// `[N, H]`, after their ReLU.
    hidden: Handle,
}

fn backward(
    saved: SavedNetwork,
    upstream: CubeTensor,
    with_features: bool,
) -> Result<NetworkGradients<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let SavedNetwork { packed, features, hidden } = saved;
    let rows = packed.rows;
    let (_, outputs) = packed.layout.places();
    let width = packed.layout.features();
    let all = packed.hidden() + outputs;
    let gradients = gpu.allocate("gradients of a network's layers", rows * all)?;
    let of_features = gpu.allocate("gradients of features", rows * width)?;
    let columns: Vec<usize> = packed
        .columns()
        .into_iter()
        .enumerate()
        .map(|(number, column)| if packed.layout.is_hidden(number) { column } else { packed.hidden() + column })
        .collect();

    let slots = packed.layout.backward_slots();
    let places = packed.layers().map(|(number, layer)| {
        let of_input = layer.input.map_or(slots.features, |input| slots.layers[input]);
        let adds = packed.layout.layers()[number + 1..].iter().any(|later| later.input == layer.input);
        let flags = usize::from(packed.layout.is_hidden(number)) + 2 * usize::from(adds);
        [slots.layers[number], of_input, columns[number], flags].map(|place| place as u32)
    });
    let uniform = packed.uniform(&Description { extra: [slots.features, 0], places: places.collect() });
    Launch::new(&gpu.client, with_rows(NETWORK_BACKWARD, packed.rows_of_group()))
        .reads(&packed.parameters.buffer)
        .reads(&hidden)
        .reads(&buffer_of(upstream))
        .writes(&gradients)
        .writes(&of_features)
        .uniform(&uniform)
        .groups(rows.div_ceil(packed.rows_of_group()))?;

    let part = rows.div_ceil(MOST_PARTS).max(PART);
    let parts = rows.div_ceil(part);
    let total = packed.parameters.places.total;
    let sums = gpu.allocate("sums of a network's gradients", parts * total)?;
    let mut tiles = 0;
    let places = packed.layers().map(|(number, layer)| {
        let along = layer.outputs.div_ceil(SIDE);
        // The biases are the weights of one more input.
        tiles += (layer.inputs + 1).div_ceil(SIDE) * along;
        let input = layer.input.map_or(FEATURES, |input| columns[input] as u32);
        [input, columns[number] as u32, tiles as u32, along as u32]
    });
    let places: Vec<[u32; 4]> = places.collect();
    let uniform = packed.uniform(&Description { extra: [part, total], places });
    Launch::new(&gpu.client, weights_kernel())
        .reads(&features)
        .reads(&hidden)
        .reads(&gradients)
        .writes(&sums)
        .uniform(&uniform)
        .groups(parts * tiles)?;
    let of_parameters = gpu.allocate("gradients of a network's parameters", total)?;
    Launch::new(&gpu.client, NETWORK_GATHER)
        .reads(&sums)
        .writes(&of_parameters)
        .uniform(&[parts as u32, total as u32])
        .invocations(total)?;

    let parameters = packed.layers().flat_map(|(number, layer)| {
        let shapes = [Shape::from([layer.inputs, layer.outputs]), Shape::from([layer.outputs])];
        [0, 1].map(|k| gpu.tensor(packed.parameters.places.of(&of_parameters, 2 * number + k), shapes[k].clone()))
    });
    let parameters = parameters.collect();
    let of_features = gpu.tensor(first_words(&of_features, rows * width), Shape::from([rows, width]));
    Ok(NetworkGradients { features: with_features.then_some(of_features), parameters })
}

impl NetworkKernels for CubeBackend {
    type Saved = SavedNetwork;

    fn network_forward(tensors: NetworkTensors<Self>, layout: NetworkLayout, keep: bool) -> (CubeTensor, SavedNetwork) {
        forward(tensors, layout, keep).unwrap_or_else(|error| error.raise())
    }

    fn network_backward(saved: SavedNetwork, gradient: CubeTensor, with_features: bool) -> NetworkGradients<Self> {
        backward(saved, gradient, with_features).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NetworkKernels> NetworkKernels for Fusion<B> {
    type Saved = B::Saved;

    fn network_forward(
        tensors: NetworkTensors<Self>,
        layout: NetworkLayout,
        keep: bool,
    ) -> (FloatTensor<Self>, B::Saved) {
        let parameters = tensors.parameters.0.into_iter().map(resolve::<B>).collect();
        let tensors = NetworkTensors { features: resolve::<B>(tensors.features), parameters: TensorList(parameters) };
        let (outputs, saved) = B::network_forward(tensors, layout, keep);
        (leaf::<B>(outputs), saved)
    }

    fn network_backward(saved: B::Saved, gradient: FloatTensor<Self>, with_features: bool) -> NetworkGradients<Self> {
        let gradients = B::network_backward(saved, resolve::<B>(gradient), with_features);
        NetworkGradients {
            features: gradients.features.map(leaf::<B>),
            parameters: gradients.parameters.into_iter().map(leaf::<B>).collect(),
        }
    }
}

/// Outputs and all gradients for some rows.
fn run(device: &Device, rows: usize, layout: &NetworkLayout) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let features = numbers.leaf(rows, layout.features(), -1.0, 1.0);
    let mut leaves = vec![features.clone()];
    let mut parameters = Vec::new();
    for layer in layout.layers() {
        // Such that numbers neither grow nor vanish from layer to layer.
        let most = (6.0 / layer.inputs as f32).sqrt();
        let weight = numbers.leaf(layer.inputs, layer.outputs, -most, most);
        let bias = numbers.leaf(1, layer.outputs, -0.5, 0.5);
        leaves.extend([weight.clone(), bias.clone()]);
        parameters.push((weight, Tensor::squeeze_dim::<1>(bias, 0)));
    }
    numbers.with_gradients(network(layout, features, parameters), &leaves)
}

/// The paper's network, and more rows than one part of them.
fn trunk_and_heads(device: &Device) -> Vec<TensorData> {
    let mut layout = NetworkLayout::default();
    let trunk = layout.add(None, [64, 64]);
    for outputs in [3, 3, 4] {
        let hidden = layout.add(Some(trunk), [64, 64]);
        layout.add(Some(hidden), [64, outputs]);
    }
    run(device, PART + 77, &layout)
}

/// Layers so wide that a workgroup has fewer rows, with sizes that are no multiple of anything.
fn wide(device: &Device) -> Vec<TensorData> {
    let mut layout = NetworkLayout::default();
    let first = layout.add(None, [37, 111]);
    let trunk = layout.add(Some(first), [111, 126]);
    layout.add(Some(trunk), [126, 48]);
    let hidden = layout.add(Some(trunk), [126, 33]);
    layout.add(Some(hidden), [33, 1]);
    run(device, 21, &layout)
}
