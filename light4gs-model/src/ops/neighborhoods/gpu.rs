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
use light4gs_shaders::{NEIGHBORHOODS, NEIGHBORHOODS_BACKWARD, Shader};

use super::{Chosen, MOST_TABLES, Neighborhoods, NeighborhoodsKernels, neighborhoods};
use crate::gpu::{Arena, Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, leaves, resolve, resolve_all};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::tensor_list::TensorList;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "neighborhoods", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [NEIGHBORHOODS, NEIGHBORHOODS_BACKWARD].map(kernel).into()
}

fn kernel(shader: Shader) -> Kernel {
    Kernel::new(shader).constant("MOST_TABLES", MOST_TABLES as u32)
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

/// The tables in the uniform of the kernels: where each begins, its columns, its first column.
fn uniform(head: [usize; 4], arena: &Arena, widths: &[usize]) -> Vec<u32> {
    let mut rows = [[0; 4]; MOST_TABLES];
    let mut first = 0;
    for (row, (start, width)) in rows.iter_mut().zip(arena.places.starts.iter().zip(widths)) {
        *row = [*start, *width, first, 0].map(|number| number as u32);
        first += width;
    }
    [&head.map(|number| number as u32), rows.as_flattened()].concat()
}

fn forward(tables: Vec<CubeTensor>, chosen: &Neighborhoods) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&tables[0])?;
    let widths: Vec<usize> = tables.iter().map(|table| table.shape()[1]).collect();
    let (columns, count) = (widths.iter().sum::<usize>(), chosen.0.len());
    let lengths: Vec<usize> = widths.iter().map(|width| width * chosen.0.count).collect();
    let tables: Vec<Handle> = tables.into_iter().map(buffer_of).collect();
    let arena = Arena::of(&gpu, "tables of numbers", &tables, &lengths)?;
    let numbers = 3 * columns * count;
    let result = gpu.allocate("rows of tables and their neighbors", numbers)?;
    Launch::new(&gpu.client, kernel(NEIGHBORHOODS))
        .reads(&UploadedRows::of(&gpu, &chosen.0).rows)
        .reads(&arena.buffer)
        .writes(&result)
        .uniform(&uniform([count, columns, NEIGHBORS, 0], &arena, &widths))
        .invocations(numbers)?;
    Ok(gpu.tensor(first_words(&result, numbers), Shape::from([3 * columns, count])))
}

fn backward(chosen: &Neighborhoods, widths: &[usize], upstream: CubeTensor) -> Result<Vec<CubeTensor>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let (columns, rows) = (widths.iter().sum::<usize>(), chosen.0.count);
    let uploaded = UploadedRows::of(&gpu, &chosen.0);
    let lengths: Vec<usize> = widths.iter().map(|width| width * rows).collect();
    let arena = Arena::new(&gpu, "gradients of tables", &lengths)?;
    Launch::new(&gpu.client, kernel(NEIGHBORHOODS_BACKWARD))
        .reads(&uploaded.starts)
        .reads(&uploaded.places)
        .reads(&buffer_of(upstream))
        .writes(&arena.buffer)
        .uniform(&uniform([rows, columns, chosen.0.len(), NEIGHBORS], &arena, widths))
        .invocations(rows * columns)?;
    let tables = widths.iter().enumerate();
    Ok(tables.map(|(k, width)| gpu.tensor(arena.tensor(k), Shape::from([rows, *width]))).collect())
}

impl NeighborhoodsKernels for CubeBackend {
    fn neighborhoods_forward(tables: TensorList<Self>, chosen: &Neighborhoods) -> CubeTensor {
        forward(tables.0, chosen).unwrap_or_else(|error| error.raise())
    }

    fn neighborhoods_backward(chosen: &Neighborhoods, widths: &[usize], gradient: CubeTensor) -> TensorList<Self> {
        TensorList(backward(chosen, widths, gradient).unwrap_or_else(|error| error.raise()))
    }
}

impl<B: FusionBackend + NeighborhoodsKernels> NeighborhoodsKernels for Fusion<B> {
    fn neighborhoods_forward(tables: TensorList<Self>, chosen: &Neighborhoods) -> FloatTensor<Self> {
        leaf::<B>(B::neighborhoods_forward(resolve_all(tables), chosen))
    }

    fn neighborhoods_backward(
        chosen: &Neighborhoods,
        widths: &[usize],
        gradient: FloatTensor<Self>,
    ) -> TensorList<Self> {
        leaves(B::neighborhoods_backward(chosen, widths, resolve::<B>(gradient)))
    }
}

/// Some rows are chosen several times.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let tables = [3, 1, 5].map(|columns| numbers.leaf(321, columns, -2.0, 2.0));
    let rows: Vec<u32> = (0..500).map(|place| place * place % 321).collect();
    let neighbors: Vec<_> = rows.iter().map(|row| [row / 2, row / 3, row / 3, row / 5]).collect();
    let found = neighborhoods(tables.to_vec(), Neighborhoods::new(&rows, &neighbors, 321));
    numbers.with_gradients(found, &tables)
}
