//! Rows of a table on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::device::DeviceId;
use cubecl::server::Handle;
use light4gs_shaders::{GATHER_ROWS, GATHER_ROWS_BACKWARD};

use super::super::context::{Gpu, Places, buffer_of, first_words};
use super::super::kernel::Kernel;
use super::super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::gather_rows::{Chosen, ChosenRows, GatherRowsKernels};

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    [GATHER_ROWS, GATHER_ROWS_BACKWARD].map(Kernel::new).into()
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

fn forward(table: CubeTensor, rows: &ChosenRows) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&table)?;
    let (columns, chosen) = (table.shape()[1], rows.0.rows.len());
    let gathered = gpu.allocate("rows of a table", chosen * columns)?;
    Launch::new(&gpu.client, GATHER_ROWS)
        .reads(&UploadedRows::of(&gpu, &rows.0).rows)
        .reads(&buffer_of(table))
        .writes(&gathered)
        .uniform(&[chosen as u32, columns as u32])
        .invocations(chosen * columns)?;
    Ok(gpu.tensor(first_words(&gathered, chosen * columns), Shape::from([columns, chosen])))
}

fn backward(rows: &ChosenRows, upstream: CubeTensor) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let (columns, chosen, count) = (upstream.shape()[0], rows.0.rows.len(), rows.0.count);
    let uploaded = UploadedRows::of(&gpu, &rows.0);
    let sums = gpu.allocate("gradients of a table", count * columns)?;
    Launch::new(&gpu.client, GATHER_ROWS_BACKWARD)
        .reads(&uploaded.starts)
        .reads(&uploaded.places)
        .reads(&buffer_of(upstream))
        .writes(&sums)
        .uniform(&[count as u32, columns as u32, chosen as u32])
        .invocations(count * columns)?;
    Ok(gpu.tensor(first_words(&sums, count * columns), Shape::from([count, columns])))
}

impl GatherRowsKernels for CubeBackend {
    fn gather_rows_forward(table: CubeTensor, rows: &ChosenRows) -> CubeTensor {
        forward(table, rows).unwrap_or_else(|error| error.raise())
    }

    fn gather_rows_backward(rows: &ChosenRows, gradient: CubeTensor) -> CubeTensor {
        backward(rows, gradient).unwrap_or_else(|error| error.raise())
    }
}
