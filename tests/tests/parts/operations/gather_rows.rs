//! Rows of tables against Burn's `select`.

use burn::tensor::{Device, Int, Tensor, TensorData};
use light4gs_model::ops::rate::gather_rows::{ChosenRows, gather_rows};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::random::Random;

/// Rows of a table as columns, and the gradient of the table for a weighted sum of them.
fn run(
    device: &Device,
    table: &[f32],
    columns: usize,
    weights: &[f32],
    chosen: impl Fn(Tensor<2>) -> Tensor<2>,
) -> [Vec<f32>; 2] {
    let device = device.clone().autodiff();
    let shape = [table.len() / columns, columns];
    let leaf = Tensor::<2>::from_data(TensorData::new(table.to_vec(), shape), &device).require_grad();
    let columns = chosen(leaf.clone());
    let weights = Tensor::<2>::from_data(TensorData::new(weights.to_vec(), columns.dims()), &device);
    let gradients = (columns.clone() * weights).sum().backward();
    [values_of(&columns), values_of(&leaf.grad(&gradients).expect("the leaf has a gradient"))]
}

#[test]
fn rows_and_gradients_are_those_of_select() {
    let mut random = Random::new(500);
    for (count, columns, chosen) in [(1, 1, 1), (5, 3, 4), (7, 30, 100), (1000, 26, 700), (3, 2, 5000)] {
        let mut numbers =
            |count: usize| -> Vec<f32> { random.normals(count).iter().map(|value| *value as f32).collect() };
        let (table, weights) = (numbers(count * columns), numbers(chosen * columns));
        let rows: Vec<u32> = (0..chosen).map(|_| random.uniform(0.0, count as f64) as u32).collect();
        let wide: Vec<i64> = rows.iter().map(|row| i64::from(*row)).collect();
        let expected = run(&Device::flex(), &table, columns, &weights, |table| {
            let rows = Tensor::<1, Int>::from_data(TensorData::from(wide.as_slice()), &table.device());
            table.select(0, rows).transpose()
        });
        for (name, device) in devices() {
            let found = run(&device, &table, columns, &weights, |table| {
                gather_rows(table, ChosenRows::new(rows.clone(), count))
            });
            let what = format!("{name}, {chosen} of {count} rows");
            assert_eq!(found[0], expected[0], "{what}");
            assert_close_relative(&format!("{what}: gradient"), &found[1], &expected[1], 1e-5);
        }
    }
}

#[test]
fn columns_of_a_wider_table() {
    for (name, device) in devices() {
        let table = Tensor::<2>::from_floats([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], &device).narrow(1, 1, 2);
        let columns = gather_rows(table, ChosenRows::new(vec![1, 1, 0], 2));
        assert_eq!(values_of(&columns), [5.0, 5.0, 2.0, 6.0, 6.0, 3.0], "{name}");
    }
}
