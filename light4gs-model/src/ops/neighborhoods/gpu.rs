//! Rows of a table and their neighbors, on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::device::DeviceId;
use cubecl::server::Handle;
use light4gs_codec::attributes::NEIGHBORS;
use light4gs_shaders::{NEIGHBORHOODS, NEIGHBORHOODS_BACKWARD};

use super::{Chosen, Neighborhoods, NeighborhoodsKernels, neighborhoods};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "neighborhoods", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [NEIGHBORHOODS, NEIGHBORHOODS_BACKWARD].map(Kernel::new).into()
}

/// Chosen rows, and where each was chosen, on a GPU.
#[derive(Clone, Debug)]
struct UploadedRows {
    device: DeviceId,
    rows: Handle,
    starts: Handle,
    places: Handle,
}

impl UploadedRows {
    /// In one buffer: a GPU waits for each upload.
    fn new(gpu: &Gpu, chosen: &Chosen) -> Self {
        let places = chosen.places();
        let arrays = [&chosen.rows, &places.starts, &places.places];
        let layout = Places::new(&arrays.map(|array| array.len()));
        let mut words = vec![0u32; layout.total];
        for (array, start) in arrays.iter().zip(&layout.starts) {
            words[*start..*start + array.len()].copy_from_slice(array);
        }
        let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        let buffer = gpu.client.create_from_slice(&bytes);
        let [rows, starts, places] = [0, 1, 2].map(|k| layout.of(&buffer, k));
        Self { device: gpu.client.service_id().device, rows, starts, places }
    }

    fn of(gpu: &Gpu, chosen: &Chosen) -> Self {
        let made = chosen.made.get_or_init(|| Box::new(Self::new(gpu, chosen))).downcast_ref::<Self>();
        match made.filter(|made| made.device == gpu.client.service_id().device) {
            Some(made) => made.clone(),
            None => Self::new(gpu, chosen),
        }
    }
}

fn forward(table: CubeTensor, chosen: &Neighborhoods) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&table)?;
    let (columns, count) = (table.shape()[1], chosen.0.len());
    let numbers = 3 * columns * count;
    let result = gpu.allocate("rows of a table and their neighbors", numbers)?;
    Launch::new(&gpu.client, NEIGHBORHOODS)
        .reads(&UploadedRows::of(&gpu, &chosen.0).rows)
        .reads(&buffer_of(table))
        .writes(&result)
        .uniform(&[count as u32, columns as u32, NEIGHBORS as u32])
        .invocations(numbers)?;
    Ok(gpu.tensor(first_words(&result, numbers), Shape::from([3 * columns, count])))
}

fn backward(chosen: &Neighborhoods, upstream: CubeTensor) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let (columns, rows) = (upstream.shape()[0] / 3, chosen.0.count);
    let uploaded = UploadedRows::of(&gpu, &chosen.0);
    let sums = gpu.allocate("gradients of a table", rows * columns)?;
    Launch::new(&gpu.client, NEIGHBORHOODS_BACKWARD)
        .reads(&uploaded.starts)
        .reads(&uploaded.places)
        .reads(&buffer_of(upstream))
        .writes(&sums)
        .uniform(&[rows as u32, columns as u32, chosen.0.len() as u32, NEIGHBORS as u32])
        .invocations(rows * columns)?;
    Ok(gpu.tensor(first_words(&sums, rows * columns), Shape::from([rows, columns])))
}

impl NeighborhoodsKernels for CubeBackend {
    fn neighborhoods_forward(table: CubeTensor, chosen: &Neighborhoods) -> CubeTensor {
        forward(table, chosen).unwrap_or_else(|error| error.raise())
    }

    fn neighborhoods_backward(chosen: &Neighborhoods, gradient: CubeTensor) -> CubeTensor {
        backward(chosen, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NeighborhoodsKernels> NeighborhoodsKernels for Fusion<B> {
    fn neighborhoods_forward(table: FloatTensor<Self>, chosen: &Neighborhoods) -> FloatTensor<Self> {
        leaf::<B>(B::neighborhoods_forward(resolve::<B>(table), chosen))
    }

    fn neighborhoods_backward(chosen: &Neighborhoods, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::neighborhoods_backward(chosen, resolve::<B>(gradient)))
    }
}

/// Some rows are chosen several times.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let table = numbers.leaf(321, 3, -2.0, 2.0);
    let rows: Vec<u32> = (0..500).map(|place| place * place % 321).collect();
    let neighbors: Vec<_> = rows.iter().map(|row| [row / 2, row / 3, row / 3, row / 5]).collect();
    numbers.with_gradients(neighborhoods(table.clone(), Neighborhoods::new(&rows, &neighbors, 321)), &[table])
}
