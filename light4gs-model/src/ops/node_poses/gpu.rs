//! Control nodes at a time, on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{NODE_POSES, NODE_POSES_BACKWARD, Shader};

use super::spline::Spline;
use super::{INPUTS, LEARNED, NodeParameters, NodePoseKernels, NodeTensors, Posing, pose};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::skinning::{MOST_AFFINITIES, POSED};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation {
    name: "node_poses",
    kernels,
    samples: &[|device| sample(device, 0), |device| sample(device, MOST_AFFINITIES)],
};

/// The kernels of this file, for every number of affinities.
fn kernels() -> Vec<Kernel> {
    let posing = [NODE_POSES, NODE_POSES_BACKWARD];
    (0..=MOST_AFFINITIES).flat_map(|count| posing.map(|shader| with_affinities(shader, count))).collect()
}

fn with_affinities(shader: Shader, affinities: usize) -> Kernel {
    Kernel::new(shader).constant("AFFINITIES", affinities as u32)
}

/// The uniform of a time.
pub(in crate::ops) fn words_of(spline: &Spline, nodes: usize, knots: usize) -> Vec<u32> {
    let counts = [nodes, knots, spline.first].map(|count| count as u32);
    counts.into_iter().chain(spline.weights.map(f32::to_bits)).chain([0]).collect()
}

pub(in crate::ops) fn starts(places: &Places) -> impl Iterator<Item = u32> {
    places.starts.iter().skip(1).map(|start| *start as u32)
}

/// Place of the affinities among the inputs.
const AFFINITIES: usize = 4;

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct PosedNodes {
    inputs: [Handle; INPUTS],
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

fn forward(nodes: NodeTensors<CubeBackend>, posing: Posing) -> Result<(CubeTensor, PosedNodes), GpuError> {
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

fn backward(saved: PosedNodes, upstream: CubeTensor) -> Result<[CubeTensor; LEARNED], GpuError> {
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
        forward(nodes, posing).unwrap_or_else(|error| error.raise())
    }

    fn node_poses_backward(saved: PosedNodes, gradient: CubeTensor) -> [CubeTensor; LEARNED] {
        backward(saved, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NodePoseKernels> NodePoseKernels for Fusion<B> {
    type Posed = B::Posed;

    fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, B::Posed) {
        let nodes = NodeTensors::from_array(nodes.into_array().map(resolve::<B>));
        let (posed, saved) = B::node_poses_forward(nodes, posing);
        (leaf::<B>(posed), saved)
    }

    fn node_poses_backward(saved: B::Posed, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED] {
        B::node_poses_backward(saved, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

fn sample(device: &Device, affinities: usize) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let nodes = NodeParameters::sample(&mut numbers, affinities);
    let leaves = [&nodes.anchors, &nodes.log_radii, &nodes.translations, &nodes.rotations].map(Clone::clone);
    let leaves: Vec<_> = leaves.into_iter().chain(nodes.affinities.clone()).collect();
    numbers.with_gradients(pose(nodes, 0.3), &leaves)
}

impl NodeParameters {
    pub(in crate::ops) fn sample(numbers: &mut Numbers, affinities: usize) -> Self {
        let (nodes, knots) = (77, 9);
        Self {
            anchors: numbers.leaf(nodes, 3, -0.7, 0.7),
            log_radii: numbers.leaf(nodes, 1, -0.7, 0.7),
            translations: numbers.leaf(knots, 3 * nodes, -0.7, 0.7),
            rotations: numbers.leaf(knots, 4 * nodes, -0.7, 0.7),
            affinities: (affinities > 0).then(|| numbers.leaf(nodes, affinities, -0.7, 0.7)),
            unit: numbers.matrix(1, 1, 2.5, 2.5).reshape([1]),
        }
    }
}
