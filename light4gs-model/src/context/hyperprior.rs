//! The hyperprior describes a plane by a small latent, which is coded first (Ballé et al. 2018; docs/design.md).

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::plane_layout::PlaneLayout;
use light4gs_codec::{Network, PlaneSource};

use super::prior::{CenteredPlanes, DescribedCondition, DescribedPrior, Passes, Prior, PriorPart};
use crate::entropy::bottleneck::{EntropyBottleneck, EntropyBottleneckConfig, Latent};
use crate::entropy::convolution::{LEAKY_SLOPE, PlaneConv, PlaneConvConfig, PlaneDeconv, PlaneDeconvConfig};

/// Configuration of a [`Hyperprior`].
#[derive(Config, Debug)]
pub struct HyperpriorConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Channels of the latent, N.
    pub latent_channels: usize,
    /// Channels between the layers of the synthesis, A and B.
    pub synthesis_channels: [usize; 2],
}

impl HyperpriorConfig {
    /// PyTorch's default initialization; that of the bottleneck is CompressAI's.
    pub fn init(&self, device: &Device) -> Hyperprior {
        let Self { channels, latent_channels: hyper, synthesis_channels: [first, second] } = *self;
        Hyperprior {
            analysis: [
                PlaneConvConfig::new(channels, hyper, 3).init(device),
                PlaneConvConfig::new(hyper, hyper, 5).with_stride(2).init(device),
                PlaneConvConfig::new(hyper, hyper, 5).with_stride(2).init(device),
            ],
            bottleneck: EntropyBottleneckConfig::new(hyper).init(device),
            synthesis_up: [
                PlaneDeconvConfig::new(hyper, first).init(device),
                PlaneDeconvConfig::new(first, second).init(device),
            ],
            synthesis_out: PlaneConvConfig::new(second, 2 * channels, 3).init(device),
        }
    }
}

/// From a plane in steps `[M, H, W]` to a latent `[N, H / 4, W / 4]`, and from the latent to Gaussian parameters `[2 M,
/// H, W]`.
#[derive(Module, Debug)]
pub struct Hyperprior {
    /// `h_a`: convolutions with strides 1, 2, 2, with ReLUs between them. Only the encoder needs them.
    pub analysis: [PlaneConv; 3],
    /// The latent's entropy model.
    pub bottleneck: EntropyBottleneck,
    /// `h_s`: two transposed convolutions, each followed by a ReLU.
    pub synthesis_up: [PlaneDeconv; 2],
    /// `h_s`: the last convolution.
    pub synthesis_out: PlaneConv,
}

impl Hyperprior {
    /// The latent `[N, H / 4, W / 4]` of a plane `[M, H, W]` in steps.
    pub fn analyze(&self, plane: Tensor<3>) -> Tensor<3> {
        let [first, second, third] = &self.analysis;
        third.forward(second.rectified(first.rectified(plane)))
    }

    /// Parameters `[2 M, H, W]` from a decoded latent `[N, H / 4, W / 4]`.
    pub fn synthesize(&self, latent: Tensor<3>) -> Tensor<3> {
        let up = self.synthesis_up.iter().fold(latent, |hidden, layer| layer.rectified(hidden));
        self.synthesis_out.forward(up)
    }

    /// The same computation as [`Self::synthesize`], for the codec's exact executor.
    pub fn synthesis_network(&self) -> Network {
        let [first, _] = &self.synthesis_up;
        let (mut network, [latent]) = Network::new([first.to_layer().inputs]);
        let up = self.synthesis_up.iter().fold(latent, |hidden, layer| {
            let doubled = network.layer(hidden, layer.to_layer());
            network.leaky_relu(doubled, LEAKY_SLOPE as f32)
        });
        let parameters = network.layer(up, self.synthesis_out.to_layer());
        network.output(parameters);
        network
    }

    /// Symbols `[N, H / 4, W / 4]` of a plane `[M, H, W]` in steps.
    pub fn symbols(&self, plane: Tensor<3>) -> Tensor<3> {
        self.bottleneck.symbols(self.analyze(plane))
    }
}

impl PriorPart for Hyperprior {
    /// Applies to every plane.
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior> {
        let received = self.bottleneck.received(self.analyze(planes.in_steps(plane)), latent);
        let latent_bits = Some(self.bottleneck.bits(received.clone()).sum());
        Some(Prior {
            parameters: Some(self.synthesize(received)),
            context: None,
            passes: Passes::AnchorsFirst,
            latent_bits,
        })
    }

    fn describe(&self, _: &PlaneLayout, _: usize) -> Option<DescribedPrior> {
        let parameters = DescribedCondition { network: self.synthesis_network(), sources: vec![PlaneSource::Latent] };
        Some(DescribedPrior { parameters: Some(parameters), context: None, passes: Passes::AnchorsFirst })
    }
}
