//! Linear blend skinning on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::server::Handle;
use light4gs_shaders::{SKINNING, SKINNING_AFFINITIES, SKINNING_BACKWARD, SKINNING_GATHER, SKINNING_NODES, Shader};

use super::context::{Gpu, Places, buffer_of, first_words};
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::skinning::{MOST_AFFINITIES, MOVED, ORIENTATION, POSE, SkinningKernels, SkinningTensors};

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
    POSE + 3 + 1 + affinities.next_multiple_of(4)
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuSaved {
    count: usize,
    nodes: usize,
    affinities: usize,
    means: Handle,
    orientations: Handle,
    stillness: Handle,
    anchors: Handle,
    precisions: Handle,
    poses: Handle,
    blended: Handle,
}

fn words(values: &[usize]) -> Vec<u32> {
    values.iter().map(|value| *value as u32).collect()
}

fn forward(tensors: SkinningTensors<CubeBackend>) -> Result<(CubeTensor, GpuSaved), GpuError> {
    let gpu = Gpu::of(&tensors.means)?;
    let (count, nodes) = (tensors.means.shape()[0], tensors.anchors.shape()[0]);
    let affinities = tensors.stillness.shape()[1] - 1;
    let [means, orientations, stillness, anchors, precisions, poses] = tensors.into_array().map(buffer_of);
    let moved = gpu.allocate("moved Gaussians", MOVED * count)?;
    let blended = gpu.allocate("blended poses", BLENDED * count)?;
    Launch::new(&gpu.client, kernel(SKINNING, affinities))
        .reads(&means)
        .reads(&orientations)
        .reads(&stillness)
        .reads(&anchors)
        .reads(&precisions)
        .reads(&poses)
        .writes(&moved)
        .writes(&blended)
        .uniform(&words(&[count, nodes]))
        .invocations(count)?;
    let output = gpu.tensor(first_words(&moved, MOVED * count), Shape::from([count, MOVED]));
    Ok((
        output,
        GpuSaved { count, nodes, affinities, means, orientations, stillness, anchors, precisions, poses, blended },
    ))
}

fn backward(saved: GpuSaved, upstream: CubeTensor) -> Result<SkinningTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let GpuSaved { count, nodes, affinities, means, orientations, stillness, anchors, precisions, poses, blended } =
        saved;
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
            .reads(&anchors)
            .reads(&precisions)
            .reads(&poses)
            .reads(&stillness)
            .updates(&of_stillness)
            .uniform(&words(&[count, nodes]))
            .invocations(count)?;
    }

    let slice = count.div_ceil(MOST_SLICES).clamp(SLICE, gpu.longest_loop());
    let slices = count.div_ceil(slice);
    let of_node = sums_of(affinities);
    let sums = gpu.allocate("sums of slices", of_node * nodes * slices)?;
    Launch::new(&gpu.client, kernel(SKINNING_NODES, affinities))
        .reads(&handed)
        .reads(&anchors)
        .reads(&precisions)
        .reads(&poses)
        .reads(&stillness)
        .writes(&sums)
        .uniform(&words(&[count, nodes, slice]))
        .invocations(slices * nodes)?;

    let places = Places::new(&[(3 + affinities) * nodes, nodes, POSE * nodes]);
    let of_nodes = gpu.allocate("gradients of nodes", places.total)?;
    let uniform = [&[nodes, slices], places.starts.as_slice()].concat();
    Launch::new(&gpu.client, kernel(SKINNING_GATHER, affinities))
        .reads(&sums)
        .writes(&of_nodes)
        .uniform(&words(&uniform))
        .invocations(of_node * nodes)?;

    let of_gaussians = |handle: &Handle, columns: usize| {
        gpu.tensor(first_words(handle, columns * count), Shape::from([count, columns]))
    };
    let of_nodes = |k: usize, columns: usize| gpu.tensor(places.of(&of_nodes, k), Shape::from([nodes, columns]));
    Ok(SkinningTensors {
        means: of_gaussians(&of_means, 3),
        orientations: of_gaussians(&of_orientations, ORIENTATION),
        stillness: of_gaussians(&of_stillness, 1 + affinities),
        anchors: of_nodes(0, 3 + affinities),
        precisions: of_nodes(1, 1),
        poses: of_nodes(2, POSE),
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
