//! The inter-plane context: a space-only plane is predicted from the space-time planes over its axes (paper III-C).

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::Operation;
use light4gs_codec::plane_layout::PlaneLayout;
use light4gs_codec::{Network, PlaneSource};

use super::prior::{CenteredPlanes, DescribedCondition, DescribedPrior, Passes, Prior, PriorPart};
use crate::entropy::bottleneck::Latent;
use crate::entropy::convolution::{PlaneConv, PlaneConvConfig};
use crate::ops::time_means::time_means;

/// Configuration of an [`InterPlane`].
#[derive(Config, Debug)]
pub struct InterPlaneConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Side of the convolution's kernel.
    #[config(default = 5)]
    pub kernel: usize,
    /// Groups of the convolution.
    #[config(default = 1)]
    pub groups: usize,
}

impl InterPlaneConfig {
    /// PyTorch's default initialization.
    pub fn init(&self, device: &Device) -> InterPlane {
        let conv = PlaneConvConfig::new(2 * self.channels, 2 * self.channels, self.kernel).with_groups(self.groups);
        InterPlane { conv: conv.init(device) }
    }
}

/// Parameters of the plane over (a, b) from the planes over (a, t) and (b, t).
///
/// Each is averaged over time, which leaves a vector along a and one along b. Both are spread over the plane and
/// concatenated; this is the context `[2 M, H, W]`, the input of a convolution. (The reference averages over space; see
/// docs/design.md.)
#[derive(Module, Debug)]
pub struct InterPlane {
    /// `[2 M, H, W]` to `[2 M, H, W]`.
    pub conv: PlaneConv,
}

impl InterPlane {
    /// The context `[2 M, B, A]` of the plane over (a, b) from `over_a [M, T, A]` and `over_b [M, T, B]`.
    ///
    /// ```
    /// use burn::tensor::{Device, Tensor};
    /// use light4gs_model::InterPlane;
    ///
    /// let device = Device::flex();
    /// let [xt, yt] = [8, 12].map(|length| Tensor::zeros([16, 4, length], &device));
    /// assert_eq!(InterPlane::context(xt, yt).dims(), [32, 12, 8]);
    /// ```
    pub fn context(over_a: Tensor<3>, over_b: Tensor<3>) -> Tensor<3> {
        time_means(over_a, over_b)
    }

    /// The same computation as [`Self::forward`], for the codec's exact executor.
    pub fn network(&self) -> Network {
        let layer = self.conv.to_layer();
        let channels = layer.inputs / 2;
        let (mut network, [over_a, over_b]) = Network::new([channels, channels]);
        let along_a = network.node(Operation::MeanOverHeight, &[over_a]);
        let along_a = network.node(Operation::Spread, &[along_a]);
        let along_b = network.node(Operation::MeanOverHeight, &[over_b]);
        let along_b = network.node(Operation::Transpose, &[along_b]);
        let along_b = network.node(Operation::Spread, &[along_b]);
        let context = network.node(Operation::Concatenate, &[along_a, along_b]);
        let parameters = network.layer(context, layer);
        network.output(parameters);
        network
    }

    /// Parameters `[2 M, B, A]` from `over_a [M, T, A]` and `over_b [M, T, B]`.
    pub fn forward(&self, over_a: Tensor<3>, over_b: Tensor<3>) -> Tensor<3> {
        self.conv.forward(Self::context(over_a, over_b))
    }
}

impl PriorPart for InterPlane {
    /// Applies to space-only planes, if the planes over their axes and time exist ([`PlaneLayout::over_time`]).
    fn prior(&self, planes: &CenteredPlanes, plane: usize, _: Latent) -> Option<Prior> {
        let [over_a, over_b] = planes.layout().over_time(plane)?.map(|source| planes.plane(source));
        let parameters = Some(self.forward(over_a, over_b));
        Some(Prior { parameters, context: None, passes: Passes::AnchorsFirst, latent_bits: None })
    }

    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        let sources =
            layout.over_time(plane)?.map(|source| PlaneSource::SameScale(layout.planes()[source].axes)).to_vec();
        let parameters = Some(DescribedCondition { network: self.network(), sources });
        Some(DescribedPrior { parameters, context: None, passes: Passes::AnchorsFirst })
    }
}
