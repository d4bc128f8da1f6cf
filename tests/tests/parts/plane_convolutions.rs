//! Convolutions over planes against Burn's own: values and gradients.

use burn::module::Param;
use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Device, Distribution, Gradients, Tensor};
use light4gs_model::{PlaneConvConfig, PlaneDeconvConfig};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};

type Output = (Tensor<3>, [Vec<f32>; 3]);

fn gradients_of(
    plane: &Tensor<3>,
    weight: &Param<Tensor<4>>,
    bias: &Param<Tensor<1>>,
    grads: &Gradients,
) -> [Vec<f32>; 3] {
    [
        values_of(&plane.grad(grads).unwrap()),
        values_of(&weight.val().grad(grads).unwrap()),
        values_of(&bias.val().grad(grads).unwrap()),
    ]
}

/// Both outputs and their gradients of one random loss.
fn compare(
    what: &str,
    plane: &Tensor<3>,
    weight: &Param<Tensor<4>>,
    bias: &Param<Tensor<1>>,
    ours: Tensor<3>,
    burns: Tensor<3>,
) {
    assert_eq!(ours.dims(), burns.dims(), "{what}");
    let loss_weights = Tensor::random(ours.dims(), Distribution::Normal(0.0, 1.0), &plane.device());
    let run = |output: Tensor<3>| -> Output {
        let grads = (output.clone() * loss_weights.clone()).sum().backward();
        (output, gradients_of(plane, weight, bias, &grads))
    };
    let ((ours, our_gradients), (burns, their_gradients)) = (run(ours), run(burns));
    assert_close_relative(&format!("{what} output"), &values_of(&ours), &values_of(&burns), 1e-5);
    for (name, (found, expected)) in
        ["plane", "weight", "bias"].into_iter().zip(our_gradients.iter().zip(&their_gradients))
    {
        assert_close_relative(&format!("{what} gradient of {name}"), found, expected, 1e-5);
    }
}

fn random_plane(shape: [usize; 3], device: &Device) -> Tensor<3> {
    Tensor::random(shape, Distribution::Normal(0.0, 1.0), device).require_grad()
}

#[test]
fn convolution() {
    for (name, device) in devices() {
        let device = device.autodiff();
        // Inputs, outputs, kernel, stride, groups; then sizes with odd lengths among them.
        for ([inputs, outputs, kernel, stride, groups], [height, width]) in [
            ([6, 4, 1, 1, 1], [5, 7]),
            ([4, 8, 3, 1, 1], [8, 5]),
            ([4, 8, 5, 1, 4], [8, 12]),
            ([6, 6, 3, 1, 6], [4, 4]),
            ([6, 9, 3, 1, 3], [3, 8]),
            ([3, 5, 5, 2, 1], [8, 12]),
            ([3, 5, 5, 2, 1], [7, 9]),
            ([4, 4, 3, 2, 2], [6, 5]),
        ] {
            let config = PlaneConvConfig::new(inputs, outputs, kernel).with_stride(stride).with_groups(groups);
            let conv = config.init(&device);
            let plane = random_plane([inputs, height, width], &device);
            let options = ConvOptions::new([stride; 2], [kernel / 2; 2], [1, 1], groups);
            let burns = conv2d(plane.clone().unsqueeze::<4>(), conv.weight.val(), Some(conv.bias.val()), options);
            let what = format!("{name} {inputs}->{outputs} kernel {kernel} stride {stride} groups {groups}");
            compare(&what, &plane, &conv.weight, &conv.bias, conv.forward(plane.clone()), burns.squeeze_dim(0));
        }
    }
}

#[test]
fn transposed_convolution() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for ([inputs, outputs], [height, width]) in [([3, 5], [4, 6]), ([4, 2], [1, 2]), ([1, 1], [3, 3])] {
            let deconv = PlaneDeconvConfig::new(inputs, outputs).init(&device);
            let plane = random_plane([inputs, height, width], &device);
            let options = ConvTransposeOptions::new([2, 2], [2, 2], [1, 1], [1, 1], 1);
            let input = plane.clone().unsqueeze::<4>();
            let burns = conv_transpose2d(input, deconv.weight.val(), Some(deconv.bias.val()), options);
            let what = format!("{name} {inputs}->{outputs} transposed, {height}×{width}");
            compare(&what, &plane, &deconv.weight, &deconv.bias, deconv.forward(plane.clone()), burns.squeeze_dim(0));
        }
    }
}
