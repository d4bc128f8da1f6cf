//! What rows of a table and their neighbors say, and the derivative.

use light4gs_codec::attributes::NEIGHBORS;
use rayon::prelude::*;

use crate::kernels::neighborhoods::Chosen;

/// Rows of the table that a parallel task of the backward pass adds up.
const CHUNK: usize = 256;

/// `[3 C, M]` of a table `[N, C]`.
pub(crate) fn forward(table: &[f32], columns: usize, chosen: &Chosen) -> Vec<f32> {
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
pub(crate) fn backward(gradient: &[f32], columns: usize, chosen: &Chosen) -> Vec<f32> {
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
