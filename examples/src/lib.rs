//! Code that the examples share: a tiny synthetic scene, a configuration that trains on it in seconds, linear layers in
//! the codec's form.

use std::path::{Path, PathBuf};

use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs::codec::network::Layer;
use light4gs::data::{DataError, RgbImage8, SyntheticOptions, write_synthetic};
use light4gs::train::config::{Config, DeviceName};

/// Result of an example: any error.
pub type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// Writes the procedural scene of the quickstart into `folder`, small: 12 training and 2 test images of 48 × 48 pixels
/// in the D-NeRF layout. Returns the scene's folder.
///
/// # Errors
/// [`DataError`] when it cannot be written.
pub fn tiny_scene(folder: &Path) -> Result<PathBuf, DataError> {
    let root = folder.join("scene");
    let options = SyntheticOptions { resolution: 48, train_frames: 12, test_frames: 2, val_frames: 0, seed: 0 };
    write_synthetic(&root, &options)?;
    Ok(root)
}

/// A configuration for that scene: 20 coarse and 100 fine iterations on the `flex` back end, small planes, no rate in the
/// loss and no pruning.
///
/// # Errors
/// None in practice: the preset is part of the library, and the tests read it.
pub fn tiny_config() -> Outcome<Config> {
    let mut config = Config::from_preset("hexplane-dnerf-cpu")?;
    config.device = DeviceName::Flex;
    config.data.initial_points = 400;
    config.model.sh_degree = 1;
    config.model.fields.hexplane.hexplane.channels = 4;
    config.model.fields.hexplane.hexplane.resolution = [16, 16, 16, 8];
    config.model.fields.hexplane.deformation.width = 16;
    config.train.coarse_iterations = 20;
    config.train.fine_iterations = 100;
    config.train.losses.photometric.l2_until = 0;
    config.train.densify.strategies.adaptive.from = 10;
    config.train.densify.strategies.adaptive.until = 60;
    config.train.densify.strategies.adaptive.interval = 20;
    config.train.prune.fraction = 0.0;
    config.train.prune.iterations = vec![80];
    Ok(config)
}

/// An image as a tensor `[H, W, 3]` in [0, 1].
pub fn image_tensor(image: &RgbImage8, device: &Device) -> Tensor<3> {
    let shape = [image.height as usize, image.width as usize, 3];
    Tensor::from_data(TensorData::new(image.to_f32().pixels, shape), device)
}

/// The means of the first and of the last tenth of a list: a loss at its start and at its end.
pub fn first_and_last(losses: &[f32]) -> (f32, f32) {
    let tenth = (losses.len() / 10).max(1);
    let mean = |part: &[f32]| part.iter().sum::<f32>() / part.len() as f32;
    (mean(&losses[..tenth]), mean(&losses[losses.len() - tenth..]))
}

/// A linear layer in the codec's form. Burn stores weights as `[inputs, outputs]`, the codec as `[outputs, inputs]`.
pub fn linear_to_layer(linear: &Linear) -> Layer {
    let values = |tensor: TensorData| tensor.iter::<f32>().collect::<Vec<f32>>();
    let bias = linear.bias.as_ref().expect("these layers have a bias");
    Layer::linear(values(linear.weight.val().transpose().into_data()), values(bias.val().into_data()))
}

/// A linear layer from the layer of a stream.
pub fn linear_from_layer(layer: &Layer, device: &Device) -> Linear {
    let shape = [layer.outputs as usize, layer.inputs as usize];
    let weight = Tensor::<2>::from_data(TensorData::new(layer.weight.clone(), shape), device).transpose();
    Linear {
        weight: Param::from_tensor(Tensor::from_data(weight.into_data(), device)),
        bias: Some(Param::from_tensor(Tensor::from_floats(layer.bias.as_slice(), device))),
    }
}
