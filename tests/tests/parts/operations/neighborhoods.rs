//! Rows of tables and their neighbors against Burn's `select`, `mean_dim` and `cat`.

use burn::tensor::{Device, Int, Tensor, TensorData};
use light4gs_codec::attributes::NEIGHBORS;
use light4gs_model::ops::neighborhoods::{Neighborhoods, neighborhoods};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::random::Random;

/// The neighborhoods of rows of a table, and the gradient of the table for a weighted sum of them.
fn run(
    device: &Device,
    table: &[f32],
    columns: usize,
    weights: &[f32],
    operation: impl Fn(Tensor<2>) -> Tensor<2>,
) -> [Vec<f32>; 2] {
    let device = device.clone().autodiff();
    let shape = [table.len() / columns, columns];
    let leaf = Tensor::<2>::from_data(TensorData::new(table.to_vec(), shape), &device).require_grad();
    let result = operation(leaf.clone());
    let weights = Tensor::<2>::from_data(TensorData::new(weights.to_vec(), result.dims()), &device);
    let gradients = (result.clone() * weights).sum().backward();
    [values_of(&result), values_of(&leaf.grad(&gradients).expect("the leaf has a gradient"))]
}

/// The same by Burn's operations.
fn by_burn(table: Tensor<2>, rows: &[u32], neighbors: &[[u32; NEIGHBORS]]) -> Tensor<2> {
    let columns = table.dims()[1];
    let chosen = |rows: &[u32]| {
        let rows: Vec<i64> = rows.iter().map(|row| i64::from(*row)).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::from(rows.as_slice()), &table.device());
        table.clone().select(0, rows).transpose()
    };
    let near = chosen(neighbors.as_flattened()).reshape([columns, rows.len(), NEIGHBORS]);
    let around = near.clone().mean_dim(2).squeeze_dim(2);
    Tensor::cat(vec![chosen(rows), around, near.narrow(2, 0, 1).squeeze_dim(2)], 0)
}

#[test]
fn values_and_gradients_are_those_of_burn() {
    let mut random = Random::new(500);
    for (count, columns, chosen) in [(1, 1, 1), (5, 3, 4), (7, 30, 100), (1000, 26, 700), (3, 2, 5000)] {
        let mut numbers =
            |count: usize| -> Vec<f32> { random.normals(count).iter().map(|value| *value as f32).collect() };
        let (table, weights) = (numbers(count * columns), numbers(3 * chosen * columns));
        let mut row = || random.uniform(0.0, count as f64) as u32;
        let rows: Vec<u32> = (0..chosen).map(|_| row()).collect();
        let neighbors: Vec<_> = (0..chosen).map(|_| [(); NEIGHBORS].map(|()| row())).collect();
        let expected = run(&Device::flex(), &table, columns, &weights, |table| by_burn(table, &rows, &neighbors));
        for (name, device) in devices() {
            let found = run(&device, &table, columns, &weights, |table| {
                // As several tables, one of them without columns.
                let first = columns.div_ceil(3);
                let nothing = Tensor::empty([count, 0], &device);
                let mut tables = vec![nothing, table.clone().narrow(1, 0, first)];
                if first < columns {
                    tables.push(table.narrow(1, first, columns - first));
                }
                neighborhoods(tables, Neighborhoods::new(&rows, &neighbors, count))
            });
            let what = format!("{name}, {chosen} of {count} rows");
            // Only the means are rounded.
            let numbers = columns * chosen;
            for exact in [0..numbers, 2 * numbers..3 * numbers] {
                assert_eq!(found[0][exact.clone()], expected[0][exact], "{what}");
            }
            assert_close_relative(&what, &found[0], &expected[0], 1e-6);
            assert_close_relative(&format!("{what}: gradient"), &found[1], &expected[1], 1e-5);
        }
    }
}

#[test]
fn columns_of_a_wider_table() {
    for (name, device) in devices() {
        let table = Tensor::<2>::from_floats([[1.0, 2.0, 3.0], [4.0, 5.0, 7.0]], &device).narrow(1, 1, 2);
        let found = neighborhoods(vec![table], Neighborhoods::new(&[1, 0], &[[0; 4], [1, 1, 1, 0]], 2));
        assert_eq!(values_of(&found), [5.0, 2.0, 7.0, 3.0, 2.0, 4.25, 3.0, 6.0, 2.0, 5.0, 3.0, 7.0], "{name}");
    }
}
