//! Columns of matrices.

use burn::tensor::Tensor;
use light4gs_model::ops::columns::columns;
use light4gs_tests::golden::{devices, values_of};
use light4gs_tests::random::Random;

#[test]
fn columns_and_their_gradients_are_those_of_slices() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for (rows, width, range) in [(1, 640, 64..128), (300, 10, 3..7), (7, 3, 0..3), (5, 4, 2..2)] {
            let mut random = Random::new(71);
            let values: Vec<f32> = (0..rows * width).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
            let run = |part: &dyn Fn(Tensor<2>) -> Tensor<2>| {
                let leaf = Tensor::<1>::from_floats(values.as_slice(), &device).reshape([rows, width]).require_grad();
                let part = part(leaf.clone());
                let loss = (part.clone() * part.clone()).sum() + (leaf.clone() * 0.0).sum();
                let gradient = leaf.grad(&loss.backward()).expect("the leaf has a gradient");
                (values_of(&part), values_of(&gradient))
            };
            let found = run(&|matrix| columns(matrix, range.clone()));
            let expected: Vec<f32> =
                values.chunks_exact(width).flat_map(|row| row[range.clone()].iter().copied()).collect();
            let gradient: Vec<f32> = (0..rows * width)
                .map(|at| if range.contains(&(at % width)) { 2.0 * values[at] } else { 0.0 })
                .collect();
            assert!(found == (expected, gradient), "{name}, {rows} rows of {width}, {range:?}");
        }
    }
}
