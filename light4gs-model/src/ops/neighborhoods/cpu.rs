//! Rows of tables and their neighbors, and the derivative.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use light4gs_codec::attributes::NEIGHBORS;
use rayon::prelude::*;

use super::{Chosen, Neighborhoods, NeighborhoodsKernels};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;
use crate::ops::tensor_list::TensorList;

/// Rows of the table that a parallel task of the backward pass adds up.
const CHUNK: usize = 256;

/// `[3 C, M]` of a table `[N, C]`.
fn forward(table: &[f32], columns: usize, chosen: &Chosen) -> Vec<f32> {
    let count = chosen.len();
    let (rows, neighbors) = chosen.rows.split_at(count);
    let (neighbors, _) = neighbors.as_chunks::<NEIGHBORS>();
    let mut result = vec![0.0; 3 * columns * count];
    result.par_chunks_exact_mut(count.max(1)).enumerate().for_each(|(i, numbers)| {
        let column = i % columns;
        let value = |row: u32| table[row as usize * columns + column];
        match i / columns {
            0 => numbers.iter_mut().zip(rows).for_each(|(number, row)| *number = value(*row)),
            1 => numbers.iter_mut().zip(neighbors).for_each(|(number, near)| {
                *number = near.iter().map(|row| value(*row)).sum::<f32>() / NEIGHBORS as f32;
            }),
            _ => numbers.iter_mut().zip(neighbors).for_each(|(number, near)| *number = value(near[0])),
        }
    });
    result
}

/// The gradient of the table `[N, C]` from that of the result. Every number adds up those of its places in their order.
fn backward(gradient: &[f32], columns: usize, chosen: &Chosen) -> Vec<f32> {
    let count = chosen.len();
    let places = chosen.places();
    let mut sums = vec![0.0; chosen.count * columns];
    sums.par_chunks_mut((CHUNK * columns).max(1)).enumerate().for_each(|(chunk, sums)| {
        for (row, sums) in sums.chunks_exact_mut(columns).enumerate() {
            let row = chunk * CHUNK + row;
            let [start, end] = [0, 1].map(|next| places.starts[row + next] as usize);
            for &place in &places.places[start..end] {
                let place = place as usize;
                let of = |part: usize, column: usize, m: usize| gradient[(part * columns + column) * count + m];
                for (column, sum) in sums.iter_mut().enumerate() {
                    *sum += match place.checked_sub(count) {
                        None => of(0, column, place),
                        Some(near) if near.is_multiple_of(NEIGHBORS) => {
                            of(1, column, near / NEIGHBORS) / NEIGHBORS as f32 + of(2, column, near / NEIGHBORS)
                        }
                        Some(near) => of(1, column, near / NEIGHBORS) / NEIGHBORS as f32,
                    };
                }
            }
        }
    });
    sums
}

fn forward_on_cpu<B: HostBackend>(tables: TensorList<B>, chosen: &Neighborhoods) -> FloatTensor<B> {
    let table = B::float_cat(tables.0, 1);
    let columns = table.shape()[1];
    let result = forward(B::to_host(table).as_slice(), columns, &chosen.0);
    B::from_values(result, [3 * columns, chosen.0.len()])
}

fn backward_on_cpu<B: HostBackend>(
    chosen: &Neighborhoods,
    widths: &[usize],
    gradient: FloatTensor<B>,
) -> TensorList<B> {
    let columns = gradient.shape()[0] / 3;
    let sums = backward(B::to_host(gradient).as_slice(), columns, &chosen.0);
    let mut first = 0;
    let table = |width: &usize| {
        let own = first..first + width;
        first += width;
        let numbers = sums.chunks_exact(columns).flat_map(|row| &row[own.clone()]).copied().collect();
        B::from_values(numbers, [chosen.0.count, *width])
    };
    TensorList(widths.iter().map(table).collect())
}

for_cpu_back_ends! {
    NeighborhoodsKernels {
        fn neighborhoods_forward(tables: TensorList<Self>, chosen: &Neighborhoods) -> FloatTensor<Self> {
            forward_on_cpu::<Self>(tables, chosen)
        }

        fn neighborhoods_backward(
            chosen: &Neighborhoods,
            widths: &[usize],
            gradient: FloatTensor<Self>,
        ) -> TensorList<Self> {
            backward_on_cpu::<Self>(chosen, widths, gradient)
        }
    }
}
