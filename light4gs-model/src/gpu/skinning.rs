//! Linear blend skinning on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::server::Handle;
use light4gs_shaders::{SKINNING, SKINNING_AFFINITIES, SKINNING_BACKWARD, SKINNING_GATHER, SKINNING_NODES, Shader};

use super::context::{Gpu, buffer_of, first_words};
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::skinning::{MOST_AFFINITIES, MOVED, ORIENTATION, POSED, SkinningKernels, SkinningTensors};

/// Values that a Gaussian saves for the backward pass, and that it hands to the nodes: five vectors each.
const BLENDED: usize = 20;
const HANDED: usize = 20;

/// Gaussians of a slice, unless there are so many slices then that their sums take more memory than they are worth.
const SLICE: usize = 64;
const MOST_SLICES: usize = 256;

/// The kernels of this file, for every number of affinities.
pub(super) fn kernels() -> Vec<Kernel> {
    let of_all = |affinities| {
        [SKINNING, SKINNING_BACKWARD, SKINNING_NODES, SKINNING_GATHER].map(|shader| kernel(shader, affinities))
    };
    let of_some = |affinities| kernel(SKINNING_AFFINITIES, affinities);
    (0..=MOST_AFFINITIES).flat_map(of_all).chain((1..=MOST_AFFINITIES).map(of_some)).collect()
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
    orientations: Handle,
    stillness: Handle,
    nodes: Handle,
    blended: Handle,
}

fn words(values: &[usize]) -> Vec<u32> {
    values.iter().map(|value| *value as u32).collect()
}

fn forward(tensors: SkinningTensors<CubeBackend>) -> Result<(CubeTensor, GpuSaved), GpuError> {
    let gpu = Gpu::of(&tensors.means)?;
    let (count, node_count) = (tensors.means.shape()[0], tensors.nodes.shape()[0]);
    let affinities = tensors.nodes.shape()[1] - POSED;
    let [means, orientations, stillness, nodes] = tensors.into_array().map(buffer_of);
    let moved = gpu.allocate("moved Gaussians", MOVED * count)?;
    let blended = gpu.allocate("blended poses", BLENDED * count)?;
    Launch::new(&gpu.client, kernel(SKINNING, affinities))
        .reads(&means)
        .reads(&orientations)
        .reads(&stillness)
        .reads(&nodes)
        .writes(&moved)
        .writes(&blended)
        .uniform(&words(&[count, node_count]))
        .invocations(count)?;
    let output = gpu.tensor(first_words(&moved, MOVED * count), Shape::from([count, MOVED]));
    Ok((output, GpuSaved { count, node_count, affinities, means, orientations, stillness, nodes, blended }))
}

fn backward(saved: GpuSaved, upstream: CubeTensor) -> Result<SkinningTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let GpuSaved { count, node_count, affinities, means, orientations, stillness, nodes, blended } = saved;
    let handed = gpu.allocate("gradients by blended poses", HANDED * count)?;
    let of_means = gpu.allocate("gradients of means", 3 * count)?;
    let of_orientations = gpu.allocate("gradients of orientations", ORIENTATION * count)?;
    let of_stillness = gpu.allocate("gradients of stillness and affinities", (1 + affinities) * count)?;
    Launch::new(&gpu.client, kernel(SKINNING_BACKWARD, affinities))
        .reads(&means)
        .reads(&orientations)
        .reads(&blended)
        .reads(&buffer_of(upstream))
        .writes(&handed)
        .writes(&of_means)
        .writes(&of_orientations)
        .writes(&of_stillness)
        .uniform(&words(&[count]))
        .invocations(count)?;
    if affinities > 0 {
        Launch::new(&gpu.client, kernel(SKINNING_AFFINITIES, affinities))
            .reads(&handed)
            .reads(&nodes)
            .reads(&stillness)
            .updates(&of_stillness)
            .uniform(&words(&[count, node_count]))
            .invocations(count)?;
    }

    let slice = count.div_ceil(MOST_SLICES).clamp(SLICE, gpu.longest_loop());
    let slices = count.div_ceil(slice);
    let of_node = sums_of(affinities);
    let sums = gpu.allocate("sums of slices", of_node * node_count * slices)?;
    Launch::new(&gpu.client, kernel(SKINNING_NODES, affinities))
        .reads(&handed)
        .reads(&nodes)
        .reads(&stillness)
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

    let rows = |handle: &Handle, rows: usize, columns: usize| {
        gpu.tensor(first_words(handle, columns * rows), Shape::from([rows, columns]))
    };
    Ok(SkinningTensors {
        means: rows(&of_means, count, 3),
        orientations: rows(&of_orientations, count, ORIENTATION),
        stillness: rows(&of_stillness, count, 1 + affinities),
        nodes: rows(&of_nodes, node_count, columns),
    })
}

impl SkinningKernels for CubeBackend {
    type Saved = GpuSaved;

    fn skinning_forward(tensors: SkinningTensors<Self>) -> (CubeTensor, GpuSaved) {
        forward(tensors).unwrap_or_else(|error| error.raise())
    }

    fn skinning_backward(saved: GpuSaved, gradient: CubeTensor) -> SkinningTensors<Self> {
        backward(saved, gradient).unwrap_or_else(|error| error.raise())
    }
}
