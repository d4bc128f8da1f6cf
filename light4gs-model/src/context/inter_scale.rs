//! The inter-scale context: a plane one scale below predicts the plane above (paper III-C).

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::Operation;
use light4gs_codec::plane_layout::PlaneLayout;
use light4gs_codec::{Network, PlaneSource};

use super::hyperprior::Hyperprior;
use super::prior::{CenteredPlanes, DescribedCondition, DescribedPrior, Passes, Prior, PriorPart};
use crate::entropy::bottleneck::Latent;
use crate::entropy::convolution::{PlaneConv, PlaneConvConfig};

/// Configuration of an [`InterScale`].
#[derive(Config, Debug)]
pub struct InterScaleConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Side of the convolution's kernel.
    #[config(default = 5)]
    pub kernel: usize,
    /// Groups of the convolution.
    #[config(default = 1)]
    pub groups: usize,
}

impl InterScaleConfig {
    /// PyTorch's default initialization.
    pub fn init(&self, device: &Device) -> InterScale {
        let conv = PlaneConvConfig::new(self.channels, 2 * self.channels, self.kernel).with_groups(self.groups);
        InterScale { conv: conv.init(device) }
    }
}

/// Parameters of a plane from the decoded plane over the same axes one scale below, upsampled to its size.
#[derive(Module, Debug)]
pub struct InterScale {
    /// `[M, H, W]` to `[2 M, H, W]`.
    pub conv: PlaneConv,
}

impl InterScale {
    /// Parameters `[2 M, H, W]` from the plane `[M, h, w]` below.
    pub fn forward(&self, lower: Tensor<3>, size: [usize; 2]) -> Tensor<3> {
        self.conv.forward(upsample(lower, size))
    }

    /// The same computation as [`Self::forward`], for the codec's exact executor.
    pub fn network(&self) -> Network {
        let layer = self.conv.to_layer();
        let (mut network, [lower]) = Network::new([layer.inputs]);
        let upsampled = network.node(Operation::Resize, &[lower]);
        let parameters = network.layer(upsampled, layer);
        network.output(parameters);
        network
    }

    fn described_contribution(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedCondition> {
        layout.one_scale_below(plane)?;
        Some(DescribedCondition { network: self.network(), sources: vec![PlaneSource::LowerScale] })
    }

    fn contribution(&self, planes: &CenteredPlanes, plane: usize) -> Option<Tensor<3>> {
        let lower = planes.one_scale_below(plane)?;
        Some(self.forward(lower, planes.layout().planes()[plane].size))
    }
}

impl PriorPart for InterScale {
    /// Applies if there is a plane below: no latent, one pass.
    fn prior(&self, planes: &CenteredPlanes, plane: usize, _: Latent) -> Option<Prior> {
        let parameters = Some(self.contribution(planes, plane)?);
        Some(Prior { parameters, context: None, passes: Passes::One, latent_bits: None })
    }

    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        let parameters = Some(self.described_contribution(layout, plane)?);
        Some(DescribedPrior { parameters, context: None, passes: Passes::One })
    }
}

/// The reference's way above the lowest scale: a hyperprior gives the parameters, and the inter-scale context is the
/// context.
#[derive(Clone, Debug)]
pub struct HighScaleHyperprior<'a> {
    /// Gives the parameters; its latent takes bits.
    pub hyperprior: &'a Hyperprior,
    /// Gives the context.
    pub inter_scale: &'a InterScale,
}

impl PriorPart for HighScaleHyperprior<'_> {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior> {
        let context = self.inter_scale.contribution(planes, plane)?;
        let hyperprior = self.hyperprior.prior(planes, plane, latent)?;
        Some(Prior { context: Some(context), passes: Passes::One, ..hyperprior })
    }

    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        let context = self.inter_scale.described_contribution(layout, plane)?;
        let hyperprior = self.hyperprior.describe(layout, plane)?;
        Some(DescribedPrior { context: Some(context), passes: Passes::One, ..hyperprior })
    }
}

/// Bilinear with corners aligned: `[C, h, w]` to `[C, H, W]`.
///
/// It is computed as two products with interpolation matrices, for which every back end has a gradient.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::upsample;
///
/// let plane = Tensor::<3>::from_floats([[[0.0, 3.0]]], &Device::flex());
/// let up = upsample(plane, [1, 4]).into_data().to_vec::<f32>().unwrap();
/// assert!(up.iter().zip([0.0, 1.0, 2.0, 3.0]).all(|(found, expected)| (found - expected).abs() < 1e-6));
/// ```
pub fn upsample(plane: Tensor<3>, [height, width]: [usize; 2]) -> Tensor<3> {
    let [channels, low_height, low_width] = plane.dims();
    let device = plane.device();
    let plane = if low_width == width {
        plane
    } else {
        let across = interpolation(low_width, width, &device).transpose();
        let wide = plane.reshape([channels * low_height, low_width]).matmul(across);
        wide.reshape([channels, low_height, width])
    };
    if low_height == height {
        return plane;
    }
    let down = interpolation(low_height, height, &device).unsqueeze::<3>().expand([channels, height, low_height]);
    down.matmul(plane)
}

/// `[to, from]`: the weights of the two neighbors of each sample.
fn interpolation(from: usize, to: usize, device: &Device) -> Tensor<2> {
    let mut weights = vec![0.0f32; to * from];
    let last = (from - 1) as f64;
    for (i, row) in weights.chunks_exact_mut(from).enumerate() {
        let place = if to > 1 { i as f64 * last / (to - 1) as f64 } else { 0.0 };
        let low = (place as usize).min(from.saturating_sub(2));
        let share = (place - low as f64) as f32;
        row[low] += 1.0 - share;
        row[(low + 1).min(from - 1)] += share;
    }
    Tensor::<1>::from_floats(weights.as_slice(), device).reshape([to, from])
}
