//! Uniform noise on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::UNIFORM_NOISE;

use super::{UniformNoiseOps, add_uniform_noise};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "uniform_noise", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![UNIFORM_NOISE.into()]
}

fn noisy(values: CubeTensor, widths: CubeTensor, which: usize, seed: [u32; 2]) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&widths)?;
    let shape = values.shape();
    let count = shape.num_elements();
    let output = gpu.allocate("noisy values", count)?;
    Launch::new(&gpu.client, UNIFORM_NOISE)
        .reads(&buffer_of(values))
        .reads(&buffer_of(widths))
        .writes(&output)
        .uniform(&[count as u32, which as u32, seed[0], seed[1]])
        .invocations(count)?;
    Ok(gpu.tensor(first_words(&output, count), shape))
}

impl UniformNoiseOps for CubeBackend {
    fn uniform_noise(
        values: FloatTensor<Self>,
        widths: FloatTensor<Self>,
        which: usize,
        seed: [u32; 2],
    ) -> FloatTensor<Self> {
        noisy(values, widths, which, seed).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + UniformNoiseOps> UniformNoiseOps for Fusion<B> {
    fn uniform_noise(
        values: FloatTensor<Self>,
        widths: FloatTensor<Self>,
        which: usize,
        seed: [u32; 2],
    ) -> FloatTensor<Self> {
        leaf::<B>(B::uniform_noise(resolve::<B>(values), resolve::<B>(widths), which, seed))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(device);
    let (values, widths) = (numbers.matrix(1, 2600, -13.0, 13.0), Tensor::from_floats([0.5, 0.25], device));
    vec![add_uniform_noise(values, widths, 1, 1 << 40 | 5).into_data()]
}
