//! LPIPS (Zhang et al. 2018), version 0.1: the distance of two images in the features of a network trained on photographs.
//!
//! The weights were published by others and are no part of this program; [`Lpips::load`] reads them from files that the user
//! names.

mod network;
mod weights;

use std::path::PathBuf;

use burn::module::{Module, Param};
use burn::nn::conv::Conv2d;
use burn::tensor::activation::relu;
use burn::tensor::module::{interpolate, max_pool2d};
use burn::tensor::ops::{InterpolateMode, InterpolateOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor};
use light4gs_data::DataError;

pub use network::LpipsNetwork;

/// Shift and scale of the images, after they are mapped to [-1, 1].
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Prevents a division by zero where all features are zero.
const EPSILON: f32 = 1e-10;

/// A network and the weights of its channels.
#[derive(Module, Debug)]
pub struct Lpips {
    /// The convolutions of the network, up to its last tap.
    convolutions: Vec<Conv2d>,
    /// Weights `[1, C, 1, 1]` for each of the five taps.
    heads: Vec<Param<Tensor<4>>>,
    #[module(skip)]
    network: LpipsNetwork,
}

impl Lpips {
    /// The networks whose weights are in the files. One file may have a network's convolutions and another its heads.
    /// The layouts are those of the `lpips` package and of torchvision, or plain `conv0.weight`...`lin4.weight`, as
    /// SafeTensors or PyTorch. Without files there are no networks.
    ///
    /// # Errors
    /// A file that cannot be read, and a network of which a part is missing or has another shape.
    pub fn load(files: &[PathBuf], device: &Device) -> Result<Vec<Self>, DataError> {
        weights::load(files, device)
    }

    /// The kind of the network.
    pub fn network(&self) -> LpipsNetwork {
        self.network
    }

    /// The distance of two images `[H, W, 3]` in [0, 1], `[1]`; 0 for equal ones. None where they are too small for the
    /// network.
    pub fn distance(&self, image: Tensor<3>, truth: Tensor<3>) -> Option<Tensor<1>> {
        self.layer_distances(image, truth).map(|layers| layers.sum())
    }

    /// The contribution of each of the five taps to [`Self::distance`], `[5]`.
    pub fn layer_distances(&self, image: Tensor<3>, truth: Tensor<3>) -> Option<Tensor<1>> {
        let maps = self.maps(image, truth)?;
        Some(Tensor::cat(maps.into_iter().map(|map| map.mean()).collect(), 0))
    }

    /// [`Self::distance`] at every pixel, `[H, W, 1]`: the map of each tap is enlarged to the size of the image
    /// (bilinear), and the maps are added.
    pub fn distance_map(&self, image: Tensor<3>, truth: Tensor<3>) -> Option<Tensor<3>> {
        let [height, width, _] = image.dims();
        let options = InterpolateOptions::new(InterpolateMode::Bilinear)
            .with_align_corners(false)
            .with_output_size([height, width]);
        let enlarged = |map: Tensor<4>| interpolate(map, options.clone()).reshape([height, width, 1]);
        self.maps(image, truth)?.into_iter().map(enlarged).reduce(|sum, part| sum + part)
    }

    /// `[1, 1, h, w]` for each tap: weighted squared differences of the normalized features.
    fn maps(&self, image: Tensor<3>, truth: Tensor<3>) -> Option<Vec<Tensor<4>>> {
        let [height, width, _] = image.dims();
        if height.min(width) < self.network.least_side() {
            return None;
        }
        let features = self.features(image).into_iter().zip(self.features(truth));
        let map = |((a, b), head): ((Tensor<4>, Tensor<4>), &Param<Tensor<4>>)| {
            ((normalized(a) - normalized(b)).powi_scalar(2) * head.val()).sum_dim(1)
        };
        Some(features.zip(&self.heads).map(map).collect())
    }

    /// `[1, C, h, w]` at each tap.
    fn features(&self, image: Tensor<3>) -> Vec<Tensor<4>> {
        let device = image.device();
        let constant = |values: [f32; 3]| Tensor::<1>::from_floats(values, &device).reshape([1, 3, 1, 1]);
        let image = image.permute([2, 0, 1]).unsqueeze_dim::<4>(0) * 2.0 - 1.0;
        let mut features = (image - constant(SHIFT)) / constant(SCALE);
        let mut taps = Vec::new();
        for (convolution, layer) in self.convolutions.iter().zip(self.network.layers()) {
            if let Some(side) = layer.pooling {
                features = max_pool2d(features, MaxPoolOptions::new([side, side]).with_stride([2, 2]));
            }
            features = relu(convolution.forward(features));
            if layer.is_tap {
                taps.push(features.clone());
            }
        }
        taps
    }
}

/// Features scaled to length 1 over the channels.
fn normalized(features: Tensor<4>) -> Tensor<4> {
    let length = features.clone().powi_scalar(2).sum_dim(1).sqrt();
    features / (length + EPSILON)
}
