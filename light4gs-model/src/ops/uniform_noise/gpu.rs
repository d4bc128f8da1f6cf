//! Uniform noise on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::UNIFORM_NOISE;

use super::cpu::words;
use super::{NoiseDraw, UniformNoiseOps, add_uniform_noise};
use crate::gpu::{Arena, Gpu, Kernel, Launch, batches, buffer_of};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaves, resolve, resolve_all};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::tensor_list::TensorList;

/// Most tensors of a launch.
const MOST_TENSORS: usize = 64;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "uniform_noise", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![kernel()]
}

fn kernel() -> Kernel {
    Kernel::new(UNIFORM_NOISE).constant("MOST_TENSORS", MOST_TENSORS as u32)
}

fn noisy(
    values: Vec<CubeTensor>,
    widths: CubeTensor,
    unit: CubeTensor,
    draws: &[NoiseDraw],
) -> Result<Vec<CubeTensor>, GpuError> {
    let gpu = Gpu::of(&widths)?;
    let (widths, unit) = (buffer_of(widths), buffer_of(unit));
    let shapes: Vec<_> = values.iter().map(|tensor| tensor.shape()).collect();
    let lengths: Vec<usize> = shapes.iter().map(|shape| shape.num_elements()).collect();
    let values: Vec<Handle> = values.into_iter().map(buffer_of).collect();
    let mut noisy = Vec::with_capacity(values.len());
    for batch in batches(&gpu, &lengths, MOST_TENSORS) {
        let (lengths, draws) = (&lengths[batch.clone()], &draws[batch.clone()]);
        let exact = Arena::of(&gpu, "values", &values[batch.clone()], lengths)?;
        let output = Arena::new(&gpu, "noisy values", lengths)?;
        let mut places = [[0; 4]; MOST_TENSORS];
        let mut seeds = [[0; 4]; MOST_TENSORS];
        for (k, draw) in draws.iter().enumerate() {
            let [start, length, width] = [output.places.starts[k], lengths[k], draw.width].map(|number| number as u32);
            places[k] = [start, length, width, draw.in_units.into()];
            seeds[k][..2].copy_from_slice(&words(draw.seed));
        }
        let total = output.places.total;
        let head = [draws.len() as u32, total as u32, 0, 0];
        Launch::new(&gpu.client, kernel())
            .reads(&exact.buffer)
            .reads(&widths)
            .reads(&unit)
            .writes(&output.buffer)
            .uniform(&[&head, places.as_flattened(), seeds.as_flattened()].concat())
            .invocations(total)?;
        noisy.extend(batch.enumerate().map(|(k, tensor)| gpu.tensor(output.tensor(k), shapes[tensor].clone())));
    }
    Ok(noisy)
}

impl UniformNoiseOps for CubeBackend {
    fn uniform_noise(
        values: TensorList<Self>,
        widths: FloatTensor<Self>,
        unit: FloatTensor<Self>,
        draws: Vec<NoiseDraw>,
    ) -> TensorList<Self> {
        TensorList(noisy(values.0, widths, unit, &draws).unwrap_or_else(|error| error.raise()))
    }
}

impl<B: FusionBackend + UniformNoiseOps> UniformNoiseOps for Fusion<B> {
    fn uniform_noise(
        values: TensorList<Self>,
        widths: FloatTensor<Self>,
        unit: FloatTensor<Self>,
        draws: Vec<NoiseDraw>,
    ) -> TensorList<Self> {
        leaves(B::uniform_noise(resolve_all(values), resolve::<B>(widths), resolve::<B>(unit), draws))
    }
}

/// More tensors than a launch takes.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(device);
    let values: Vec<Tensor<1>> =
        (0..MOST_TENSORS + 2).map(|k| numbers.matrix(1, 1 + 17 * k, -13.0, 13.0).flatten(0, 1)).collect();
    let (widths, unit) = (Tensor::from_floats([0.5, 0.25], device), Tensor::from_floats([3.0], device));
    let draw = |k: usize| NoiseDraw { width: k % 2, in_units: k.is_multiple_of(3), seed: (k as u64) << 40 | 5 };
    let draws = (0..values.len()).map(draw).collect();
    add_uniform_noise(values, widths, unit, draws).into_iter().map(|tensor| tensor.into_data()).collect()
}
