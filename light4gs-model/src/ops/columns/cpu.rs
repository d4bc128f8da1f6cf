//! Columns in their place among zeros, on a CPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;

use super::ColumnsKernels;
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

fn placed_on_cpu<B: HostBackend>(columns: FloatTensor<B>, first: usize, width: usize) -> FloatTensor<B> {
    let [rows, count] = columns.shape().dims();
    let mut placed = vec![0.0; rows * width];
    if count > 0 {
        let columns = B::to_host(columns);
        for (row, own) in placed.chunks_exact_mut(width).zip(columns.as_slice().chunks_exact(count)) {
            row[first..first + count].copy_from_slice(own);
        }
    }
    B::from_values(placed, [rows, width])
}

for_cpu_back_ends! {
    ColumnsKernels {
        fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
            placed_on_cpu::<Self>(columns, first, width)
        }
    }
}
