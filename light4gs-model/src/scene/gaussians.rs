//! The static set of Gaussians.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::rendering::MAX_LOG_SCALE;
use light4gs_data::PointCloud;

/// Configuration of [`Gaussians`].
#[derive(Config, Debug)]
pub struct GaussiansConfig {
    /// Degree of the spherical harmonics, 0 to 3.
    #[config(default = 3)]
    pub sh_degree: usize,
    /// Opacity at the start, in (0, 1).
    #[config(default = 0.1)]
    pub opacity: f32,
}

impl GaussiansConfig {
    /// One Gaussian a point: isotropic, as large as the root of the mean squared distance to the three nearest
    /// neighbors, unrotated, in the point's color.
    pub fn init(&self, cloud: &PointCloud, device: &Device) -> Gaussians {
        let count = cloud.positions.len();
        let log_scales: Vec<f32> = cloud.mean_squared_distances().iter().flat_map(|d2| [0.5 * d2.ln(); 3]).collect();
        let dc = cloud.sh_dc().concat();
        let logit = (self.opacity / (1.0 - self.opacity)).ln();
        let rest = (self.sh_degree + 1).pow(2) - 1;
        let quats = [1.0, 0.0, 0.0, 0.0].repeat(count);
        Gaussians::from_tensors(GaussianTensors {
            means: matrix(cloud.positions.concat(), 3, device),
            log_scales: matrix(log_scales, 3, device),
            quats: matrix(quats, 4, device),
            opacity_logits: Tensor::full([count, 1], logit, device),
            sh_dc: Tensor::from_data(TensorData::new(dc, [count, 1, 3]), device),
            sh_rest: Tensor::zeros([count, rest, 3], device),
        })
    }
}

fn matrix(values: Vec<f32>, columns: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values.clone(), [values.len() / columns, columns]), device)
}

/// Raw attributes of N Gaussians as tensors: at rest or at a time.
#[derive(Clone, Debug)]
pub struct GaussianTensors {
    /// `[N, 3]`, world units.
    pub means: Tensor<2>,
    /// `[N, 3]`, natural logarithms of standard deviations in world units.
    pub log_scales: Tensor<2>,
    /// `[N, 4]` as (w, x, y, z), of any length but zero.
    pub quats: Tensor<2>,
    /// `[N, 1]`.
    pub opacity_logits: Tensor<2>,
    /// `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Tensor<3>,
}

impl GaussianTensors {
    /// The same values off the tape; tensors that were never on one stay as they are.
    pub fn inner(self) -> Self {
        fn inner<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
            if tensor.device().is_autodiff() { tensor.inner() } else { tensor }
        }
        Self {
            means: inner(self.means),
            log_scales: inner(self.log_scales),
            quats: inner(self.quats),
            opacity_logits: inner(self.opacity_logits),
            sh_dc: inner(self.sh_dc),
            sh_rest: inner(self.sh_rest),
        }
    }
}

/// Attributes of N Gaussians as they are drawn: standard deviations and opacities in place of what is trained for them.
#[derive(Clone, Debug)]
pub struct ActivatedGaussians {
    /// `[N, 3]`, world units.
    pub means: Tensor<2>,
    /// `[N, 4]` as (w, x, y, z), of any length but zero.
    pub quats: Tensor<2>,
    /// `[N, 3]`, standard deviations in world units.
    pub scales: Tensor<2>,
    /// `[N, 1]` in [0, 1].
    pub opacities: Tensor<2>,
    /// `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Tensor<3>,
}

impl GaussianTensors {
    /// The exponential of the logarithms, the sigmoid of the logits.
    pub fn activated(self) -> ActivatedGaussians {
        ActivatedGaussians {
            means: self.means,
            quats: self.quats,
            scales: self.log_scales.clamp_max(MAX_LOG_SCALE).exp(),
            opacities: sigmoid(self.opacity_logits),
            sh_dc: self.sh_dc,
            sh_rest: self.sh_rest,
        }
    }
}

/// Trained attributes of N Gaussians.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::PointCloud;
/// use light4gs_model::GaussiansConfig;
///
/// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
/// let gaussians = GaussiansConfig::new().init(&cloud, &Device::flex());
/// assert_eq!(gaussians.len(), 2);
/// assert_eq!(gaussians.sh_rest.dims(), [2, 15, 3]);
/// ```
#[derive(Module, Debug)]
pub struct Gaussians {
    /// `[N, 3]`, world units.
    pub means: Param<Tensor<2>>,
    /// `[N, 3]`, natural logarithms of standard deviations in world units.
    pub log_scales: Param<Tensor<2>>,
    /// `[N, 4]` as (w, x, y, z).
    pub quats: Param<Tensor<2>>,
    /// `[N, 1]`.
    pub opacity_logits: Param<Tensor<2>>,
    /// `[N, 1, 3]`.
    pub sh_dc: Param<Tensor<3>>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Param<Tensor<3>>,
}

impl Gaussians {
    /// Makes parameters of tensors.
    pub fn from_tensors(tensors: GaussianTensors) -> Self {
        Self {
            means: Param::from_tensor(tensors.means),
            log_scales: Param::from_tensor(tensors.log_scales),
            quats: Param::from_tensor(tensors.quats),
            opacity_logits: Param::from_tensor(tensors.opacity_logits),
            sh_dc: Param::from_tensor(tensors.sh_dc),
            sh_rest: Param::from_tensor(tensors.sh_rest),
        }
    }

    /// The attributes at rest, on the tape where autodiff is on.
    pub fn tensors(&self) -> GaussianTensors {
        GaussianTensors {
            means: self.means.val(),
            log_scales: self.log_scales.val(),
            quats: self.quats.val(),
            opacity_logits: self.opacity_logits.val(),
            sh_dc: self.sh_dc.val(),
            sh_rest: self.sh_rest.val(),
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.dims()[0]
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Degree of the spherical harmonics.
    pub fn sh_degree(&self) -> usize {
        (self.sh_rest.dims()[1] + 1).isqrt() - 1
    }
}
