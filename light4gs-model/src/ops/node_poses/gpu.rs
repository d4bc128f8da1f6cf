//! Control nodes on a GPU: their poses, and their regularizer.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{NODE_POSES, NODE_POSES_BACKWARD, NODE_REGULARIZER, NODE_STRAIN, SCALE, Shader};

use super::context::{Gpu, Places, buffer_of, first_words};
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::node_poses::{self, NodePoseKernels, NodeTensors, Posing};
use crate::kernels::node_regularizer::{self, NodeRegularizerKernels, ROTATIONS, Regularization, RegularizedTensors};
use crate::kernels::skinning::{MOST_AFFINITIES, POSED};
use crate::kernels::spline::Spline;

/// Values that a node sums up over its neighbors and knots: four vectors.
const SUMS: usize = 16;

/// The kernels of this file, for every number of affinities.
pub(super) fn kernels() -> Vec<Kernel> {
    let posing = [NODE_POSES, NODE_POSES_BACKWARD];
    let posing = (0..=MOST_AFFINITIES).flat_map(|count| posing.map(|shader| with_affinities(shader, count)));
    posing.chain([NODE_STRAIN, NODE_REGULARIZER, SCALE].map(Kernel::new)).collect()
}

fn with_affinities(shader: Shader, affinities: usize) -> Kernel {
    Kernel::new(shader).constant("AFFINITIES", affinities as u32)
}

/// The uniform of a time.
fn words_of(spline: &Spline, nodes: usize, knots: usize) -> Vec<u32> {
    let counts = [nodes, knots, spline.first].map(|count| count as u32);
    counts.into_iter().chain(spline.weights.map(f32::to_bits)).chain([0]).collect()
}

fn starts(places: &Places) -> impl Iterator<Item = u32> {
    places.starts.iter().skip(1).map(|start| *start as u32)
}

/// Where they are among the inputs.
const AFFINITIES: usize = 4;

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct PosedNodes {
    inputs: [Handle; node_poses::INPUTS],
    nodes: usize,
    knots: usize,
    posing: Posing,
}

impl PosedNodes {
    fn spline(&self) -> Vec<u32> {
        words_of(&Spline::at(self.posing.time, self.knots), self.nodes, self.knots)
    }

    /// Columns of a posed node.
    fn columns(&self) -> usize {
        POSED + self.posing.affinities
    }
}

fn pose(nodes: NodeTensors<CubeBackend>, posing: Posing) -> Result<(CubeTensor, PosedNodes), GpuError> {
    let gpu = Gpu::of(&nodes.anchors)?;
    let (count, knots) = (nodes.anchors.shape()[0], nodes.translations.shape()[0]);
    let mut inputs = nodes.into_array().map(buffer_of);
    if posing.affinities == 0 {
        // The placeholder may be a tensor that is bound already.
        inputs[AFFINITIES] = gpu.allocate("no affinities", 1)?;
    }
    let saved = PosedNodes { inputs, nodes: count, knots, posing };
    let values = saved.columns() * count;
    let posed = gpu.allocate("posed nodes", values)?;
    let launch = Launch::new(&gpu.client, with_affinities(NODE_POSES, posing.affinities));
    let launch = saved.inputs.iter().fold(launch, Launch::reads);
    launch.writes(&posed).uniform(&saved.spline()).invocations(count)?;
    Ok((gpu.tensor(first_words(&posed, values), Shape::from([count, saved.columns()])), saved))
}

fn pose_backward(saved: PosedNodes, upstream: CubeTensor) -> Result<[CubeTensor; node_poses::LEARNED], GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let [anchors, log_radii, translations, rotations, _, unit] = &saved.inputs;
    let PosedNodes { nodes, knots, posing: Posing { affinities, .. }, .. } = saved;
    let shapes = [[nodes, 3], [nodes, 1], [knots, 3 * nodes], [knots, 4 * nodes], [nodes, affinities]];
    let places = Places::new(&shapes.map(|[rows, columns]| rows * columns));
    let gradients = gpu.allocate("gradients of nodes", places.total)?;
    let uniform: Vec<u32> = saved.spline().into_iter().chain(starts(&places)).collect();
    Launch::new(&gpu.client, with_affinities(NODE_POSES_BACKWARD, affinities))
        .reads(anchors)
        .reads(log_radii)
        .reads(translations)
        .reads(rotations)
        .reads(unit)
        .reads(&buffer_of(upstream))
        .writes(&gradients)
        .uniform(&uniform)
        .invocations(nodes)?;
    Ok(std::array::from_fn(|k| gpu.tensor(places.of(&gradients, k), Shape::from(shapes[k]))))
}

impl NodePoseKernels for CubeBackend {
    type Posed = PosedNodes;

    fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (CubeTensor, PosedNodes) {
        pose(nodes, posing).unwrap_or_else(|error| error.raise())
    }

    fn node_poses_backward(saved: PosedNodes, gradient: CubeTensor) -> [CubeTensor; node_poses::LEARNED] {
        pose_backward(saved, gradient).unwrap_or_else(|error| error.raise())
    }
}

/// Gradients for a loss that counts once: of anchors, translations and rotations, in one buffer.
#[derive(Clone, Debug)]
pub struct RegularizedNodes {
    gradients: Handle,
    nodes: usize,
    knots: usize,
}

/// Shapes of the gradients, and where they are in the buffer.
fn places_of(nodes: usize, knots: usize) -> ([[usize; 2]; node_regularizer::LEARNED], Places) {
    let shapes = [[nodes, 3], [knots, 3 * nodes], [knots, 4 * nodes]];
    (shapes, Places::new(&shapes.map(|[rows, columns]| rows * columns)))
}

fn regularize(
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

fn regularize_backward(
    derivatives: RegularizedNodes,
    upstream: CubeTensor,
) -> Result<[CubeTensor; node_regularizer::LEARNED], GpuError> {
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
        regularize(nodes, regularization).unwrap_or_else(|error| error.raise())
    }

    fn node_regularizer_backward(
        derivatives: RegularizedNodes,
        gradient: CubeTensor,
    ) -> [CubeTensor; node_regularizer::LEARNED] {
        regularize_backward(derivatives, gradient).unwrap_or_else(|error| error.raise())
    }
}
