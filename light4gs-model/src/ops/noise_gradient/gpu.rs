//! The gradient of the logarithms of noise's widths on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{NOISE_GRADIENT, SUM_BLOCKS};

use super::{NoiseGradientOps, NoisyTensors, NoisyValues, noise_gradient};
use crate::gpu::{Arena, Gpu, Kernel, Launch, batches, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve_all};
use crate::ops::sample::{GpuOperation, Numbers};

/// Most tensors of a launch, and most sums.
const MOST_TENSORS: usize = 64;
/// Numbers that a workgroup adds up.
const BLOCK: usize = 4096;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "noise_gradient", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![products(), sums()]
}

fn products() -> Kernel {
    Kernel::new(NOISE_GRADIENT).constant("MOST_TENSORS", MOST_TENSORS as u32).constant("BLOCK", BLOCK as u32)
}

fn sums() -> Kernel {
    Kernel::new(SUM_BLOCKS).constant("MOST_SUMS", MOST_TENSORS as u32)
}

fn gradient_of(tensors: NoisyTensors<CubeBackend>, places: &[usize], count: usize) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&tensors.noisy.0[0])?;
    let NoisyTensors { noisy, exact, gradients } = tensors;
    let lengths: Vec<usize> = noisy.0.iter().map(|tensor| tensor.shape().num_elements()).collect();
    let lists = [noisy, exact, gradients].map(|list| list.0.into_iter().map(buffer_of).collect::<Vec<Handle>>());
    let blocks: Vec<usize> = lengths.iter().map(|length| length.div_ceil(BLOCK)).collect();
    let of_blocks = gpu.allocate("sums of blocks", blocks.iter().sum())?;
    let mut before = 0;
    let mut ranges = vec![[0; 4]; count];
    for batch in batches(&gpu, &lengths, MOST_TENSORS) {
        let lengths = &lengths[batch.clone()];
        let mut arenas = Vec::with_capacity(lists.len());
        for (name, list) in ["noisy values", "exact values", "gradients"].into_iter().zip(&lists) {
            arenas.push(Arena::of(&gpu, name, &list[batch.clone()], lengths)?);
        }
        let mut rows = [[0; 4]; MOST_TENSORS];
        let mut own = 0;
        for (k, tensor) in batch.enumerate() {
            rows[k] = [own, arenas[0].places.starts[k], lengths[k], 0].map(|number| number as u32);
            own += blocks[tensor];
            ranges[places[tensor]] = [before + own - blocks[tensor], before + own, 0, 0].map(|number| number as u32);
        }
        let head = [lengths.len() as u32, own as u32, before as u32, 0];
        let launch =
            arenas.iter().fold(Launch::new(&gpu.client, products()), |launch, arena| launch.reads(&arena.buffer));
        launch.updates_if(before > 0, &of_blocks).uniform(&[&head, rows.as_flattened()].concat()).groups(own)?;
        before += own;
    }
    let found = gpu.allocate("gradient of the widths of noise", count)?;
    let mut launched = 0;
    for ranges in ranges.chunks(MOST_TENSORS) {
        let mut rows = [[0; 4]; MOST_TENSORS];
        rows[..ranges.len()].copy_from_slice(ranges);
        Launch::new(&gpu.client, sums())
            .reads(&of_blocks)
            .updates_if(launched > 0, &found)
            .uniform(&[&[ranges.len() as u32, launched, 0, 0], rows.as_flattened()].concat())
            .groups(ranges.len())?;
        launched += ranges.len() as u32;
    }
    Ok(gpu.tensor(first_words(&found, count), Shape::from([count])))
}

impl NoiseGradientOps for CubeBackend {
    fn noise_gradient(tensors: NoisyTensors<Self>, places: Vec<usize>, count: usize) -> FloatTensor<Self> {
        gradient_of(tensors, &places, count).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NoiseGradientOps> NoiseGradientOps for Fusion<B> {
    fn noise_gradient(tensors: NoisyTensors<Self>, places: Vec<usize>, count: usize) -> FloatTensor<Self> {
        let tensors = NoisyTensors {
            noisy: resolve_all(tensors.noisy),
            exact: resolve_all(tensors.exact),
            gradients: resolve_all(tensors.gradients),
        };
        leaf::<B>(B::noise_gradient(tensors, places, count))
    }
}

/// More tensors than a launch takes, some of them of several blocks, and places without a tensor.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(device);
    let mut row = |count: usize| -> Tensor<1> { numbers.matrix(1, count, -1.0, 1.0).flatten(0, 1) };
    let mut values = |k: usize| {
        let count = if k == 3 { 3 * BLOCK + 1 } else { 1 + 7 * k };
        NoisyValues { noisy: row(count), exact: row(count), gradient: row(count) }
    };
    let tensors = (0..MOST_TENSORS + 9).map(|k| (!k.is_multiple_of(10)).then(|| values(k))).collect();
    noise_gradient(tensors).into_iter().map(|gradient| gradient.into_data()).collect()
}
