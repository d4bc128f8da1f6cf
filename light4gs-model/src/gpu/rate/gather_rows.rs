//! Rows of a table on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::server::Handle;
use light4gs_shaders::{GATHER_ROWS, GATHER_ROWS_BACKWARD};

use super::super::context::{Gpu, Places, buffer_of, first_words};
use super::super::kernel::Kernel;
use super::super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::gather_rows::{ChosenRows, GatherRowsKernels};

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    [GATHER_ROWS, GATHER_ROWS_BACKWARD].map(Kernel::new).into()
}

/// Where each row of the table was chosen.
#[derive(Clone, Debug)]
pub struct GpuChosen {
    count: usize,
    starts: Handle,
    places: Handle,
}

/// Several arrays in one buffer: what is uploaded once makes the device wait once.
fn upload<const K: usize>(gpu: &Gpu, arrays: [&[u32]; K]) -> [Handle; K] {
    let layout = Places::new(&arrays.map(<[u32]>::len));
    let mut words = vec![0u32; layout.total];
    for (array, start) in arrays.iter().zip(&layout.starts) {
        words[*start..*start + array.len()].copy_from_slice(array);
    }
    let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    let buffer = gpu.client.create_from_slice(&bytes);
    std::array::from_fn(|k| layout.of(&buffer, k))
}

fn forward(table: CubeTensor, rows: &ChosenRows) -> Result<(CubeTensor, GpuChosen), GpuError> {
    let gpu = Gpu::of(&table)?;
    let columns = table.shape()[1];
    let (starts, places) = rows.places();
    let [own, starts, places] = upload(&gpu, [&rows.rows, &starts, &places]);
    let gathered = gpu.allocate("rows of a table", rows.len() * columns)?;
    Launch::new(&gpu.client, GATHER_ROWS)
        .reads(&own)
        .reads(&buffer_of(table))
        .writes(&gathered)
        .uniform(&[rows.len() as u32, columns as u32])
        .invocations(rows.len() * columns)?;
    let output = gpu.tensor(first_words(&gathered, rows.len() * columns), Shape::from([rows.len(), columns]));
    Ok((output, GpuChosen { count: rows.count, starts, places }))
}

fn backward(chosen: &GpuChosen, upstream: CubeTensor) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let columns = upstream.shape()[1];
    let values = chosen.count * columns;
    let sums = gpu.allocate("gradients of a table", values)?;
    Launch::new(&gpu.client, GATHER_ROWS_BACKWARD)
        .reads(&chosen.starts)
        .reads(&chosen.places)
        .reads(&buffer_of(upstream))
        .writes(&sums)
        .uniform(&[chosen.count as u32, columns as u32])
        .invocations(values)?;
    Ok(gpu.tensor(first_words(&sums, values), Shape::from([chosen.count, columns])))
}

impl GatherRowsKernels for CubeBackend {
    type Chosen = GpuChosen;

    fn gather_rows_forward(table: CubeTensor, rows: ChosenRows) -> (CubeTensor, GpuChosen) {
        forward(table, &rows).unwrap_or_else(|error| error.raise())
    }

    fn gather_rows_backward(chosen: GpuChosen, gradient: CubeTensor) -> CubeTensor {
        backward(&chosen, gradient).unwrap_or_else(|error| error.raise())
    }
}
