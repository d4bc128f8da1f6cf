//! The deformation network: from a hexplane feature to changes of a Gaussian's attributes (paper III-A).

use burn::config::Config;
use burn::module::Module;
use burn::nn::{Initializer, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use super::field::Offsets;

/// Configuration of a [`Deformation`].
#[derive(Config, Debug)]
pub struct DeformationConfig {
    /// Length of the incoming feature.
    pub feature_size: usize,
    /// Width of every hidden layer.
    #[config(default = 64)]
    pub width: usize,
    /// Layers of the trunk: 1 is a single linear layer (0 means the same), more add ReLU and a layer each.
    #[config(default = 1)]
    pub depth: usize,
    /// Whether positions change.
    #[config(default = true)]
    pub position: bool,
    /// Whether logarithms of scales change.
    #[config(default = true)]
    pub scale: bool,
    /// Whether quaternions change.
    #[config(default = true)]
    pub rotation: bool,
    /// Whether opacity logits change.
    #[config(default = false)]
    pub opacity: bool,
    /// Whether spherical harmonics change (all of degree 3).
    #[config(default = false)]
    pub sh: bool,
}

fn linear(inputs: usize, outputs: usize, device: &Device) -> Linear {
    LinearConfig::new(inputs, outputs).with_initializer(Initializer::XavierUniform { gain: 1.0 }).init(device)
}

impl DeformationConfig {
    /// Xavier-uniform weights.
    pub fn init(&self, device: &Device) -> Deformation {
        let trunk = (0..self.depth.max(1))
            .map(|layer| linear(if layer == 0 { self.feature_size } else { self.width }, self.width, device))
            .collect();
        let head = |wanted: bool, outputs: usize| {
            wanted.then(|| DeformationHead {
                hidden: linear(self.width, self.width, device),
                output: linear(self.width, outputs, device),
            })
        };
        Deformation {
            trunk,
            position: head(self.position, 3),
            scale: head(self.scale, 3),
            rotation: head(self.rotation, 4),
            opacity: head(self.opacity, 1),
            sh: head(self.sh, 48),
        }
    }
}

/// ReLU, linear, ReLU, linear: from the trunk's output to the change of one attribute.
#[derive(Module, Debug)]
pub struct DeformationHead {
    /// `[W]` to `[W]`.
    pub hidden: Linear,
    /// `[W]` to the attribute's size.
    pub output: Linear,
}

impl DeformationHead {
    /// `rectified [N, W]` is the trunk's output after its ReLU, which all heads share.
    fn forward(&self, rectified: Tensor<2>) -> Tensor<2> {
        self.output.forward(relu(self.hidden.forward(rectified)))
    }
}

/// A trunk and a head for each attribute that changes.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::DeformationConfig;
///
/// let device = Device::flex();
/// let deformation = DeformationConfig::new(16).with_width(32).init(&device);
/// let offsets = deformation.forward(Tensor::zeros([5, 16], &device));
/// assert_eq!(offsets.position.unwrap().dims(), [5, 3]);
/// assert!(offsets.sh.is_none());
/// ```
#[derive(Module, Debug)]
pub struct Deformation {
    /// At least one layer.
    pub trunk: Vec<Linear>,
    /// `[N, 3]`.
    pub position: Option<DeformationHead>,
    /// `[N, 3]`.
    pub scale: Option<DeformationHead>,
    /// `[N, 4]`.
    pub rotation: Option<DeformationHead>,
    /// `[N, 1]`.
    pub opacity: Option<DeformationHead>,
    /// `[N, 48]`.
    pub sh: Option<DeformationHead>,
}

impl Deformation {
    /// The trunk's output `[N, W]`, before the heads' ReLU, from features `[N, F]`.
    pub fn hidden(&self, features: Tensor<2>) -> Tensor<2> {
        let mut layers = self.trunk.iter();
        let first = layers.next().expect("a trunk has at least one layer").forward(features);
        layers.fold(first, |hidden, layer| layer.forward(relu(hidden)))
    }

    /// Changes of the attributes from features `[N, F]`.
    pub fn forward(&self, features: Tensor<2>) -> Offsets {
        let rectified = relu(self.hidden(features));
        let run = |head: &Option<DeformationHead>| head.as_ref().map(|head| head.forward(rectified.clone()));
        let count = rectified.dims()[0];
        Offsets {
            position: run(&self.position),
            scale: run(&self.scale),
            rotation: run(&self.rotation),
            opacity: run(&self.opacity),
            sh: run(&self.sh).map(|sh| sh.reshape([count, 16, 3])),
        }
    }
}
