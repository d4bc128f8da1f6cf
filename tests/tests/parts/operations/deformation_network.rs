//! The deformation network in one operation against its layers one by one.

use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::ops::deformation_network::{MOST_LAYERS, NetworkLayout, network};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::random::Random;

type Parameters = Vec<(Tensor<2>, Tensor<1>)>;

/// Burn's own products, sums and ReLUs.
fn layer_by_layer(layout: &NetworkLayout, features: Tensor<2>, parameters: Parameters) -> Tensor<2> {
    let mut outputs: Vec<Tensor<2>> = Vec::new();
    for (layer, (weight, bias)) in layout.layers().iter().zip(parameters) {
        let input = layer.input.map_or_else(|| features.clone(), |input| relu(outputs[input].clone()));
        outputs.push(input.matmul(weight) + bias.unsqueeze_dim(0));
    }
    let is_read = |number| layout.layers().iter().any(|layer| layer.input == Some(number));
    let outputs = outputs.into_iter().enumerate().filter(|(number, _)| !is_read(*number));
    Tensor::cat(outputs.map(|(_, output)| output).collect(), 1)
}

struct Case {
    layout: NetworkLayout,
    rows: usize,
    features: usize,
    /// Features, weights and biases in turn, then the gradient of the output.
    values: Vec<TensorData>,
}

impl Case {
    fn new(random: &mut Random, rows: usize, layers: &[(Option<usize>, [usize; 2])]) -> Self {
        let mut layout = NetworkLayout::default();
        for (input, sizes) in layers {
            layout.add(*input, *sizes);
        }
        let mut matrix = |rows: usize, columns: usize, scale: f64| {
            let values: Vec<f32> = random.normals(rows * columns).iter().map(|value| (scale * value) as f32).collect();
            TensorData::new(values, [rows, columns])
        };
        let features = layers[0].1[0];
        let mut values = vec![matrix(rows, features, 1.0)];
        let mut width = 0;
        for (number, (_, [inputs, outputs])) in layers.iter().enumerate() {
            // Such that numbers neither grow nor vanish from layer to layer.
            values.push(matrix(*inputs, *outputs, (2.0 / *inputs as f64).sqrt()));
            values.push(matrix(1, *outputs, 0.3));
            if layers.iter().all(|(input, _)| *input != Some(number)) {
                width += outputs;
            }
        }
        values.push(matrix(rows, width, 1.0));
        Self { layout, rows, features, values }
    }

    /// The output, and the gradients of features, weights and biases.
    fn run(&self, device: &Device, run: impl Fn(&NetworkLayout, Tensor<2>, Parameters) -> Tensor<2>) -> Vec<Vec<f32>> {
        let device = device.clone().autodiff();
        let mut tensors: Vec<Tensor<2>> =
            self.values.iter().map(|values| Tensor::from_data(values.clone(), &device)).collect();
        let upstream = tensors.pop().expect("the last one");
        let leaves: Vec<Tensor<2>> = tensors.into_iter().map(Tensor::require_grad).collect();
        let parameters = leaves[1..].chunks(2).map(|pair| (pair[0].clone(), pair[1].clone().squeeze_dim(0)));
        let output = run(&self.layout, leaves[0].clone(), parameters.collect());
        let gradients = (output.clone() * upstream).sum().backward();
        let of_leaves = leaves.iter().map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient")));
        std::iter::once(values_of(&output)).chain(of_leaves).collect()
    }
}

#[test]
fn outputs_and_gradients_are_those_of_the_layers_one_by_one() {
    let mut random = Random::new(710);
    let deep: Vec<(Option<usize>, [usize; 2])> =
        (0..MOST_LAYERS).map(|layer: usize| (layer.checked_sub(1), [9, 9])).collect();
    let paper: &[(Option<usize>, [usize; 2])] = &[
        (None, [64, 64]),
        (Some(0), [64, 64]),
        (Some(1), [64, 3]),
        (Some(0), [64, 64]),
        (Some(3), [64, 3]),
        (Some(0), [64, 64]),
        (Some(5), [64, 4]),
    ];
    // Two layers that read the features, and one whose readers are far apart.
    let tree: &[(Option<usize>, [usize; 2])] = &[
        (None, [5, 7]),
        (None, [5, 2]),
        (Some(0), [7, 13]),
        (Some(2), [13, 1]),
        (Some(0), [7, 8]),
        (Some(2), [13, 6]),
    ];
    let wide: &[(Option<usize>, [usize; 2])] =
        &[(None, [31, 128]), (Some(0), [128, 127]), (Some(1), [127, 48]), (Some(1), [127, 128]), (Some(3), [128, 4])];
    for (rows, layers) in [(1, tree), (130, &[(None, [3, 2])]), (700, paper), (257, tree), (50, &deep[..]), (129, wide)]
    {
        let case = Case::new(&mut random, rows, layers);
        assert!(case.layout.fits());
        let expected = case.run(&Device::flex(), layer_by_layer);
        for (name, device) in devices() {
            let found = case.run(&device, network);
            assert_eq!(found.len(), expected.len());
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let what = format!("{name}, {} rows of {} features, tensor {k}", case.rows, case.features);
                assert_close_relative(&what, found, expected, 2e-5);
            }
        }
    }
}

/// Parameters that are frozen, and features off the tape: the one parameter that learns has the same gradient as before.
#[test]
fn constants_get_no_gradient() {
    let case = Case::new(&mut Random::new(711), 40, &[(None, [4, 6]), (Some(0), [6, 2])]);
    // Output, features, then weights.
    let expected = case.run(&Device::flex(), layer_by_layer);
    for (name, device) in devices() {
        let device = device.autodiff();
        let constants: Vec<Tensor<2>> =
            case.values.iter().map(|values| Tensor::from_data(values.clone(), &device)).collect();
        let tensor = |k: usize| constants[k].clone();
        let weight = tensor(1).require_grad();
        let parameters = [(weight.clone(), tensor(2).squeeze_dim(0)), (tensor(3), tensor(4).squeeze_dim(0))];
        let gradients = (network(&case.layout, tensor(0), parameters) * tensor(5)).sum().backward();
        let found = values_of(&weight.grad(&gradients).expect("of the only parameter on the tape"));
        assert_close_relative(name, &found, &expected[2], 2e-5);
        assert!(constants.iter().all(|constant| constant.grad(&gradients).is_none()), "{name}");
    }
}

#[test]
fn a_network_that_no_workgroup_holds_does_not_fit() {
    let mut layout = NetworkLayout::default();
    assert!(!layout.fits(), "no layers");
    let first = layout.add(None, [32, 256]);
    layout.add(Some(first), [256, 256]);
    assert!(layout.fits());
    layout.add(Some(first), [256, 257]);
    assert!(!layout.fits());
}
