//! Convolutions over planes against Burn's own: values and gradients.

use burn::module::Param;
use burn::tensor::activation::leaky_relu;
use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Device, Distribution, Gradients, Tensor};
use light4gs_model::{LEAKY_SLOPE, PlaneConvConfig, PlaneDeconvConfig, anchor_mask, checkerboard_kernel};
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
            // A tape serves one backward pass.
            let burns = || -> Tensor<3> {
                let plane = plane.clone().unsqueeze::<4>();
                conv2d(plane, conv.weight.val(), Some(conv.bias.val()), options.clone()).squeeze_dim(0)
            };
            let what = format!("{name} {inputs}->{outputs} kernel {kernel} stride {stride} groups {groups}");
            compare(&what, &plane, &conv.weight, &conv.bias, conv.forward(plane.clone()), burns());
            let rectified = conv.rectified(plane.clone());
            let what = format!("{what}, rectified");
            compare(&what, &plane, &conv.weight, &conv.bias, rectified, leaky_relu(burns(), LEAKY_SLOPE));
        }
    }
}

/// Masked taps are neither used nor have a gradient, whatever their weights are; nor have anchors that are left out.
#[test]
fn checkerboard_convolution() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for groups in [1, 4] {
            let config = PlaneConvConfig::new(4, 8, 5).with_groups(groups).with_checkerboard(true);
            let mut conv = config.init(&device);
            conv.weight = Param::from_tensor(Tensor::random([8, 4 / groups, 5, 5], Distribution::Default, &device));
            let plane = random_plane([4, 6, 9], &device);
            let options = ConvOptions::new([1; 2], [2; 2], [1, 1], groups);
            // A tape serves one backward pass.
            let burns = || -> Tensor<3> {
                let weight = conv.weight.val() * checkerboard_kernel(5, &device).unsqueeze::<4>();
                conv2d(plane.clone().unsqueeze::<4>(), weight, Some(conv.bias.val()), options.clone()).squeeze_dim(0)
            };
            let what = format!("{name} checkerboard, groups {groups}");
            compare(&what, &plane, &conv.weight, &conv.bias, conv.forward(plane.clone()), burns());
            let others = anchor_mask([6, 9], &device).neg() + 1.0;
            let what = format!("{what}, without anchors");
            compare(&what, &plane, &conv.weight, &conv.bias, conv.without_anchors(plane.clone()), burns() * others);
        }
    }
}

/// A part of the channels is the whole with zeros in place of the others.
#[test]
fn convolution_of_a_part() {
    for (name, device) in devices() {
        let conv = PlaneConvConfig::new(6, 4, 1).init(&device);
        let part = Tensor::random([3, 5, 7], Distribution::Normal(0.0, 1.0), &device);
        let zeros = Tensor::zeros([3, 5, 7], &device);
        let whole = conv.rectified(Tensor::cat(vec![zeros, part.clone()], 0));
        let found = values_of(&conv.rectified_part(part, 3));
        assert_close_relative(&format!("{name} part"), &found, &values_of(&whole), 1e-6);
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
            let burns = leaky_relu(burns.squeeze_dim::<3>(0), LEAKY_SLOPE);
            compare(&what, &plane, &deconv.weight, &deconv.bias, deconv.rectified(plane.clone()), burns);
        }
    }
}
