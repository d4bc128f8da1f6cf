//! Columns in their place among zeros, on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::PLACE_COLUMNS;

use super::{ColumnsKernels, columns};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "columns", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![PLACE_COLUMNS.into()]
}

fn placed(columns: CubeTensor, first: usize, width: usize) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&columns)?;
    let [rows, count] = columns.shape().dims();
    let size = rows * width;
    let matrix = gpu.allocate("columns among zeros", size)?;
    Launch::new(&gpu.client, PLACE_COLUMNS)
        .reads(&buffer_of(columns))
        .writes(&matrix)
        .uniform(&[size, width, first, count].map(|number| number as u32))
        .invocations(size)?;
    Ok(gpu.tensor(first_words(&matrix, size), Shape::from([rows, width])))
}

impl ColumnsKernels for CubeBackend {
    fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
        placed(columns, first, width).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + ColumnsKernels> ColumnsKernels for Fusion<B> {
    fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
        leaf::<B>(B::place_columns(resolve::<B>(columns), first, width))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let matrix = numbers.leaf(26, 100, -1.0, 1.0);
    numbers.with_gradients(columns(matrix.clone(), 1..3), &[matrix])
}
