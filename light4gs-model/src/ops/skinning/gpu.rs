//! Linear blend skinning on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::{Device, Shape, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use cubecl::server::Handle;
use light4gs_shaders::{SKINNING, SKINNING_BACKWARD, SKINNING_GATHER, SKINNING_NODES, Shader};

use super::{
    INPUTS, MOST_AFFINITIES, MOVED, Moved, MovedTensors, POSED, SkinningInputs, SkinningKernels, SkinningTensors, skin,
};
use crate::gpu::{Arena, Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// Values that a Gaussian saves for the backward pass, and that it hands to the nodes: five and four vectors.
const BLENDED: usize = 20;
const HANDED: usize = 16;

/// Gaussians of a slice. Where that makes more than [`MOST_SLICES`], whose sums take memory, slices are longer.
const SLICE: usize = 64;
const MOST_SLICES: usize = 256;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation {
    name: "skinning",
    kernels,
    samples: &[|device| sample(device, 0), |device| sample(device, MOST_AFFINITIES)],
};

/// The kernels of this file, for every number of affinities.
fn kernels() -> Vec<Kernel> {
    let shaders = [SKINNING, SKINNING_BACKWARD, SKINNING_NODES, SKINNING_GATHER];
    (0..=MOST_AFFINITIES).flat_map(|affinities| shaders.map(|shader| kernel(shader, affinities))).collect()
}

fn kernel(shader: Shader, affinities: usize) -> Kernel {
    Kernel::new(shader).constant("AFFINITIES", affinities as u32).constant("SUMS", sums_of(affinities) as u32)
}

/// Sums that a node has of each slice of the Gaussians, in fours.
fn sums_of(affinities: usize) -> usize {
    POSED + affinities.next_multiple_of(4)
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuSaved {
    count: usize,
    node_count: usize,
    affinities: usize,
    means: Handle,
    quats: Handle,
    of_gaussians: Handle,
    nodes: Handle,
    blended: Handle,
}

fn words(values: &[usize]) -> Vec<u32> {
    values.iter().map(|value| *value as u32).collect()
}

/// Lengths of moved positions and quaternions.
fn lengths(count: usize) -> [usize; 2] {
    MOVED.map(|columns| columns * count)
}

fn forward(tensors: SkinningTensors<CubeBackend>) -> Result<(MovedTensors<CubeBackend>, GpuSaved), GpuError> {
    let gpu = Gpu::of(&tensors.means)?;
    let (count, node_count) = (tensors.means.shape()[0], tensors.nodes.shape()[0]);
    let affinities = tensors.affinities.shape()[1];
    let [means, quats, stillness, of_gaussians, nodes] = tensors.into_array().map(buffer_of);
    let moved = Arena::new(&gpu, "moved Gaussians", &lengths(count))?;
    let blended = gpu.allocate("blended poses", BLENDED * count)?;
    Launch::new(&gpu.client, kernel(SKINNING, affinities))
        .reads(&means)
        .reads(&quats)
        .reads(&stillness)
        .reads(&of_gaussians)
        .reads(&nodes)
        .writes(&moved.buffer)
        .writes(&blended)
        .uniform(&words(&[count, node_count, moved.places.starts[1]]))
        .invocations(count)?;
    let part = |k: usize| gpu.tensor(moved.tensor(k), Shape::from([count, MOVED[k]]));
    let output = MovedTensors { means: part(0), quats: part(1) };
    let saved = GpuSaved { count, node_count, affinities, means, quats, of_gaussians, nodes, blended };
    Ok((output, saved))
}

fn backward(saved: GpuSaved, upstream: MovedTensors<CubeBackend>) -> Result<SkinningTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream.means)?;
    let GpuSaved { count, node_count, affinities, means, quats, of_gaussians, nodes, blended } = saved;
    let upstream = [upstream.means, upstream.quats].map(buffer_of);
    let upstream = Arena::of(&gpu, "gradients of moved Gaussians", &upstream, &lengths(count))?;
    // What the Gaussians hand to the nodes, and their gradients, in the order of the inputs.
    let widths = [HANDED, 3, 4, 1, affinities];
    let layout = Places::new(&widths.map(|width| width * count));
    let results = gpu.allocate("gradients of Gaussians", layout.total)?;
    let [_, of_means, of_quats, of_stillness, of_affinities] = layout.starts[..] else { unreachable!("five arrays") };
    let starts = [upstream.places.starts[1], of_means, of_quats, of_stillness, of_affinities];
    Launch::new(&gpu.client, kernel(SKINNING_BACKWARD, affinities))
        .reads(&means)
        .reads(&quats)
        .reads(&blended)
        .reads(&upstream.buffer)
        .reads(&nodes)
        .reads(&of_gaussians)
        .writes(&results)
        .uniform(&words(&[&[count, node_count][..], &starts].concat()))
        .invocations(count)?;
    let handed = layout.of(&results, 0);

    let slice = count.div_ceil(MOST_SLICES).clamp(SLICE, gpu.longest_loop());
    let slices = count.div_ceil(slice);
    let of_node = sums_of(affinities);
    let sums = gpu.allocate("sums of slices", of_node * node_count * slices)?;
    Launch::new(&gpu.client, kernel(SKINNING_NODES, affinities))
        .reads(&handed)
        .reads(&nodes)
        .reads(&of_gaussians)
        .writes(&sums)
        .uniform(&words(&[count, node_count, slice]))
        .invocations(slices * node_count)?;

    let columns = POSED + affinities;
    let of_nodes = gpu.allocate("gradients of nodes", columns * node_count)?;
    Launch::new(&gpu.client, kernel(SKINNING_GATHER, affinities))
        .reads(&sums)
        .writes(&of_nodes)
        .uniform(&words(&[node_count, slices]))
        .invocations(of_node * node_count)?;

    let of_nodes = gpu.tensor(first_words(&of_nodes, columns * node_count), Shape::from([node_count, columns]));
    let mut of_gaussians = (1..INPUTS).map(|k| gpu.tensor(layout.of(&results, k), Shape::from([count, widths[k]])));
    let mut next = || of_gaussians.next().expect("a piece for each input");
    Ok(SkinningTensors::from_array([next(), next(), next(), next(), of_nodes]))
}

impl SkinningKernels for CubeBackend {
    type Saved = GpuSaved;

    fn skinning_forward(tensors: SkinningTensors<Self>) -> (MovedTensors<Self>, GpuSaved) {
        forward(tensors).unwrap_or_else(|error| error.raise())
    }

    fn skinning_backward(saved: GpuSaved, gradients: MovedTensors<Self>) -> SkinningTensors<Self> {
        backward(saved, gradients).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + SkinningKernels> SkinningKernels for Fusion<B> {
    type Saved = B::Saved;

    fn skinning_forward(tensors: SkinningTensors<Self>) -> (MovedTensors<Self>, B::Saved) {
        let tensors = SkinningTensors::from_array(tensors.into_array().map(resolve::<B>));
        let (moved, saved) = B::skinning_forward(tensors);
        (MovedTensors { means: leaf::<B>(moved.means), quats: leaf::<B>(moved.quats) }, saved)
    }

    fn skinning_backward(saved: B::Saved, gradients: MovedTensors<Self>) -> SkinningTensors<Self> {
        let gradients = MovedTensors { means: resolve::<B>(gradients.means), quats: resolve::<B>(gradients.quats) };
        let gradients = B::skinning_backward(saved, gradients).into_array();
        SkinningTensors::from_array(gradients.map(leaf::<B>))
    }
}

fn sample(device: &Device, affinities: usize) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let (gaussians, nodes) = (777, 21);
    let mut of_gaussians = |columns, low, high| numbers.leaf(gaussians, columns, low, high);
    let [means, quats] = [3, 4].map(|columns| of_gaussians(columns, -1.0, 1.0));
    let stillness = of_gaussians(1, -3.0, 1.0);
    let own = (affinities > 0).then(|| of_gaussians(affinities, -3.0, 1.0));
    let nodes = numbers.leaf(nodes, POSED + affinities, 0.0, 1.0);
    let inputs = SkinningInputs { affinities: own, ..SkinningInputs::new(means, quats, stillness, nodes) };
    let leaves = [&inputs.means, &inputs.quats, &inputs.stillness, &inputs.nodes].map(Clone::clone);
    let leaves: Vec<_> = leaves.into_iter().chain(inputs.affinities.clone()).collect();
    let Moved { means, quats } = skin(inputs);
    numbers.with_gradients(Tensor::cat(vec![means, quats], 1), &leaves)
}
