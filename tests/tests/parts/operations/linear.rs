//! Linear layers against Burn's own products and sums.

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::ops::linear::linear;
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::random::Random;

/// Output and gradients of a weighted sum of it.
fn run(
    device: &Device,
    shapes: [[usize; 2]; 4],
    values: &[Vec<f32>; 4],
    layer: impl Fn(Tensor<2>, Tensor<2>, Tensor<1>) -> Tensor<2>,
) -> [Vec<f32>; 4] {
    let device = device.clone().autodiff();
    let tensor = |k: usize| Tensor::<2>::from_data(TensorData::new(values[k].clone(), shapes[k]), &device);
    let leaves = [0, 1, 2].map(|k| tensor(k).require_grad());
    let [input, weight, bias] = leaves.clone();
    let output = layer(input, weight, bias.squeeze_dim(0));
    let gradients = (output.clone() * tensor(3)).sum().backward();
    let [input, weight, bias] = leaves.map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient")));
    [values_of(&output), input, weight, bias]
}

/// One part, whole parts, a rest, and more parts than are added up.
#[test]
fn outputs_and_gradients_are_those_of_products_and_sums() {
    let mut random = Random::new(700);
    for [count, inputs, outputs] in
        [[1, 3, 2], [127, 5, 7], [256, 64, 64], [257, 1, 1], [1000, 16, 3], [33_333, 7, 4], [4000, 75, 25]]
    {
        let shapes = [[count, inputs], [inputs, outputs], [1, outputs], [count, outputs]];
        let values = shapes.map(|[rows, columns]| -> Vec<f32> {
            random.normals(rows * columns).iter().map(|value| *value as f32).collect()
        });
        let expected =
            run(&Device::flex(), shapes, &values, |input, weight, bias| input.matmul(weight) + bias.unsqueeze_dim(0));
        for (name, device) in devices() {
            let found = run(&device, shapes, &values, linear);
            for (k, what) in ["output", "gradient of input", "of weight", "of bias"].into_iter().enumerate() {
                let what = format!("{name}, {count} rows of {inputs} to {outputs}: {what}");
                assert_close_relative(&what, &found[k], &expected[k], 2e-5);
            }
        }
    }
}

#[test]
fn rows_may_lie_in_memory_as_they_like() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let input = Tensor::<2>::from_floats([[1.0, 3.0], [2.0, 4.0]], &device).transpose();
        let weight = Tensor::<2>::from_floats([[1.0, 10.0]], &device).transpose().require_grad();
        let output = linear(input, weight.clone(), Tensor::zeros([1], &device));
        assert_eq!(values_of(&output), [21.0, 43.0], "{name}");
        let gradients = output.sum().backward();
        assert_eq!(values_of(&weight.grad(&gradients).unwrap()), [4.0, 6.0], "{name}");
    }
}

#[test]
fn no_rows_are_no_error() {
    for (name, device) in devices() {
        let shapes = [[0, 3], [3, 2], [1, 2], [0, 2]];
        let values = shapes.map(|[rows, columns]| vec![1.0; rows * columns]);
        let [output, _, weight, bias] = run(&device, shapes, &values, linear);
        assert!(output.is_empty() && weight.iter().chain(&bias).all(|value| *value == 0.0), "{name}");
    }
}
