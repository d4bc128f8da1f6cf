//! Sums of tensors on a GPU, in one buffer.

use burn::backend::TensorMetadata;
use burn::tensor::{Device, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;

use super::{SumsOps, sums};
use crate::gpu::{Arena, Gpu, PACKED_BUFFERS, batches, buffer_of};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaves, resolve_all};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::tensor_list::TensorList;

/// The operation for checks. Its kernel is the one that packs tensors, of the shared code for GPUs.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "sums", kernels: Vec::new, samples: &[sample] };

fn sums_of(parts: Vec<CubeTensor>, numbers: Vec<usize>) -> Result<Vec<CubeTensor>, GpuError> {
    let gpu = Gpu::of(&parts[0])?;
    let mut parts = parts.into_iter();
    let (mut shapes, mut lists) = (Vec::new(), Vec::new());
    for number in numbers {
        let list: Vec<CubeTensor> = parts.by_ref().take(number).collect();
        shapes.push(list[0].shape());
        lists.push(list.into_iter().map(buffer_of).collect::<Vec<Handle>>());
    }
    let lengths: Vec<usize> = shapes.iter().map(|shape| shape.num_elements()).collect();
    for (list, length) in lists.iter_mut().zip(&lengths) {
        while list.len() > PACKED_BUFFERS {
            let first: Vec<Handle> = list.drain(..PACKED_BUFFERS).collect();
            list.insert(0, Arena::of_sums(&gpu, "sums", &[&first], &[*length])?.tensor(0));
        }
    }
    let lists: Vec<&[Handle]> = lists.iter().map(Vec::as_slice).collect();
    let mut sums = Vec::with_capacity(lists.len());
    for batch in batches(&gpu, &lengths, usize::MAX) {
        let arena = Arena::of_sums(&gpu, "sums", &lists[batch.clone()], &lengths[batch.clone()])?;
        sums.extend(batch.enumerate().map(|(k, sum)| gpu.tensor(arena.tensor(k), shapes[sum].clone())));
    }
    Ok(sums)
}

impl SumsOps for CubeBackend {
    fn sums(parts: TensorList<Self>, numbers: Vec<usize>) -> TensorList<Self> {
        TensorList(sums_of(parts.0, numbers).unwrap_or_else(|error| error.raise()))
    }
}

impl<B: FusionBackend + SumsOps> SumsOps for Fusion<B> {
    fn sums(parts: TensorList<Self>, numbers: Vec<usize>) -> TensorList<Self> {
        leaves(B::sums(resolve_all(parts), numbers))
    }
}

/// More sums than one launch makes, one of them of more parts.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut random = Numbers::new(device);
    let mut part = |count: usize| -> Tensor<1> { random.matrix(1, count, -13.0, 13.0).flatten(0, 1) };
    let lists = (1..=9).map(|k| (0..[1, 2, 3, 17][k % 4]).map(|_| part(k * k * k * k)).collect()).collect();
    sums(lists).into_iter().map(|sum| sum.into_data()).collect()
}
