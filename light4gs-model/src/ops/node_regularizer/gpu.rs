//! The regularizer of control nodes on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{NODE_REGULARIZER, NODE_STRAIN, SCALE};

use super::{LEARNED, NodeRegularizerKernels, ROTATIONS, Regularization, RegularizedTensors, regularize};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::node_poses::NodeParameters;
use crate::ops::node_poses::gpu::{starts, words_of};
use crate::ops::node_poses::spline::Spline;
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "node_regularizer", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [NODE_STRAIN, NODE_REGULARIZER, SCALE].map(Kernel::new).into()
}

/// Values that a node sums up over its neighbors and knots: four vectors.
const SUMS: usize = 16;

/// Gradients for a loss that counts once: of anchors, translations and rotations, in one buffer.
#[derive(Clone, Debug)]
pub struct RegularizedNodes {
    gradients: Handle,
    nodes: usize,
    knots: usize,
}

/// Shapes of the gradients, and where they are in the buffer.
fn places_of(nodes: usize, knots: usize) -> ([[usize; 2]; LEARNED], Places) {
    let shapes = [[nodes, 3], [knots, 3 * nodes], [knots, 4 * nodes]];
    (shapes, Places::new(&shapes.map(|[rows, columns]| rows * columns)))
}

fn forward(
    nodes: RegularizedTensors<CubeBackend>,
    regularization: Regularization,
) -> Result<(CubeTensor, RegularizedNodes), GpuError> {
    let gpu = Gpu::of(&nodes.anchors)?;
    let Regularization { rigidity, smoothness, time } = regularization;
    let (count, knots) = (nodes.anchors.shape()[0], nodes.translations.shape()[0]);
    let [anchors, translations, rotations, log_radii] = nodes.into_array().map(buffer_of);
    let spline = words_of(&Spline::at(time, knots), count, knots);
    let sums = gpu.allocate("sums over neighbors", SUMS * count)?;
    Launch::new(&gpu.client, NODE_STRAIN)
        .reads(&anchors)
        .reads(&log_radii)
        .reads(&translations)
        .reads(&rotations)
        .writes(&sums)
        .uniform(&spline)
        .invocations(count)?;

    let (_, places) = places_of(count, knots);
    let loss = gpu.allocate("loss of nodes", 1)?;
    let gradients = gpu.allocate("gradients of nodes", places.total)?;
    let weights = [rigidity, smoothness, smoothness * ROTATIONS].map(f32::to_bits);
    let uniform: Vec<u32> = spline.into_iter().chain(weights).chain(starts(&places)).collect();
    Launch::new(&gpu.client, NODE_REGULARIZER)
        .reads(&sums)
        .reads(&translations)
        .reads(&rotations)
        .writes(&loss)
        .writes(&gradients)
        .uniform(&uniform)
        .invocations(count)?;
    let loss = gpu.tensor(first_words(&loss, 1), Shape::from([1]));
    Ok((loss, RegularizedNodes { gradients, nodes: count, knots }))
}

fn backward(derivatives: RegularizedNodes, upstream: CubeTensor) -> Result<[CubeTensor; LEARNED], GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let (shapes, places) = places_of(derivatives.nodes, derivatives.knots);
    let scaled = gpu.allocate("gradients of nodes", places.total)?;
    Launch::new(&gpu.client, SCALE)
        .reads(&derivatives.gradients)
        .reads(&buffer_of(upstream))
        .writes(&scaled)
        .uniform(&[places.total as u32])
        .invocations(places.total)?;
    Ok(std::array::from_fn(|k| gpu.tensor(places.of(&scaled, k), Shape::from(shapes[k]))))
}

impl NodeRegularizerKernels for CubeBackend {
    type Derivatives = RegularizedNodes;

    fn node_regularizer_forward(
        nodes: RegularizedTensors<Self>,
        regularization: Regularization,
    ) -> (CubeTensor, RegularizedNodes) {
        forward(nodes, regularization).unwrap_or_else(|error| error.raise())
    }

    fn node_regularizer_backward(derivatives: RegularizedNodes, gradient: CubeTensor) -> [CubeTensor; LEARNED] {
        backward(derivatives, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NodeRegularizerKernels> NodeRegularizerKernels for Fusion<B> {
    type Derivatives = B::Derivatives;

    fn node_regularizer_forward(
        nodes: RegularizedTensors<Self>,
        regularization: Regularization,
    ) -> (FloatTensor<Self>, B::Derivatives) {
        let nodes = RegularizedTensors::from_array(nodes.into_array().map(resolve::<B>));
        let (loss, derivatives) = B::node_regularizer_forward(nodes, regularization);
        (leaf::<B>(loss), derivatives)
    }

    fn node_regularizer_backward(
        derivatives: B::Derivatives,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; LEARNED] {
        B::node_regularizer_backward(derivatives, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let nodes = NodeParameters::sample(&mut numbers, 0);
    let leaves = [&nodes.anchors, &nodes.translations, &nodes.rotations].map(Clone::clone);
    let loss = regularize(nodes, Regularization { rigidity: 0.75, smoothness: 0.5, time: 0.6 });
    numbers.with_gradients(loss, &leaves)
}
