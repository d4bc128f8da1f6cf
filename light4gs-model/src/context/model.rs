//! The multiscale hexplane context model, MHCM (paper III-C; DESIGN section 6): a Gaussian for every value of every plane.
//!
//! One set of weights for all planes, from the lowest scale up. Which part speaks for a plane:
//!
//! | plane | parameters | then |
//! |---|---|---|
//! | lowest scale, space-time | [`Hyperprior`] of the plane itself | [`Checkerboard`] |
//! | lowest scale, space-only | [`InterPlane`], from the decoded space-time planes | [`Checkerboard`] |
//! | higher scales | [`InterScale`], from the decoded plane one scale below | all at once |
//!
//! Where a part is switched off, the next one that applies takes its place: inter-scale, inter-plane, hyperprior,
//! then a constant.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::plane_layout::{coding_order, is_space_time};

use super::checkerboard::{Checkerboard, CheckerboardConfig, anchor_mask};
use super::entropy_parameters::{EntropyParameters, EntropyParametersConfig, Start};
use super::hyperprior::{Hyperprior, HyperpriorConfig};
use super::inter_plane::{InterPlane, InterPlaneConfig};
use super::inter_scale::{HighScaleHyperprior, InterScale, InterScaleConfig};
use super::prior::{CenteredPlanes, Passes, Prior, PriorPart};
use crate::entropy::bottleneck::Latent;
use crate::entropy::gaussian_conditional::{NormalParameters, bits, gaussian_likelihood};
use crate::entropy::quantization_steps::PlaneSteps;

/// Parts of a [`ContextModel`], each of which an ablation may switch off.
#[derive(Config, Debug, PartialEq)]
pub struct ContextParts {
    /// A transmitted latent for planes that nothing else describes.
    #[config(default = true)]
    pub hyperprior: bool,
    /// Anchors first, the others in sight of them.
    #[config(default = true)]
    pub checkerboard: bool,
    /// Space-only planes from space-time planes.
    #[config(default = true)]
    pub inter_plane: bool,
    /// Higher scales from the scale below.
    #[config(default = true)]
    pub inter_scale: bool,
    /// The reference's: a transmitted latent for higher scales too, with the inter-scale context beside it.
    #[config(default = false)]
    pub high_scale_hyperprior: bool,
}

/// Kernel and groups of a convolution.
#[derive(Config, Debug, PartialEq)]
pub struct KernelShape {
    /// Side of the kernel, odd.
    pub kernel: usize,
    /// Groups of channels.
    pub groups: usize,
}

/// Configuration of a [`ContextModel`]. Take one of the presets and change what you like.
#[derive(Config, Debug)]
pub struct ContextModelConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Channels of the hyperprior's latent, N.
    pub hyper_channels: usize,
    /// Channels between the layers of the hyperprior's synthesis, A and B.
    pub synthesis_channels: [usize; 2],
    /// Widths of the hidden layers of [`EntropyParameters`], C and D.
    pub parameter_channels: [usize; 2],
    /// Groups of the checkerboard's convolution.
    pub context_groups: usize,
    /// The inter-plane convolution.
    pub inter_plane: KernelShape,
    /// The inter-scale convolution.
    pub inter_scale: KernelShape,
    /// What is there.
    #[config(default = "ContextParts::new()")]
    pub parts: ContextParts,
    /// Subtracted from the space-only planes before anything else.
    #[config(default = 0.0)]
    pub space_only_center: f64,
    /// Subtracted from the space-time planes before anything else; they start at 1.
    #[config(default = 1.0)]
    pub space_time_center: f64,
    /// How the last layer starts.
    #[config(default = "Start::Unit")]
    pub start: Start,
}

impl ContextModelConfig {
    /// The sizes, centres, composition and initial values of the authors' code for planes of M channels.
    pub fn reference(channels: usize) -> Self {
        let kernel = KernelShape::new(5, 1);
        let hidden = [10 * channels / 3, 8 * channels / 3];
        let synthesis = [channels, 3 * channels / 2];
        Self::new(channels, (channels / 8).max(1), synthesis, hidden, 1, kernel.clone(), kernel)
            .with_parts(ContextParts::new().with_high_scale_hyperprior(true))
            .with_space_time_center(0.0)
            .with_start(Start::PyTorch)
    }

    /// Few weights, since they are part of the file: about 6000 in the decoder for 16 channels. Contexts look at each channel by
    /// itself; only the 1×1 layers mix channels.
    pub fn compact(channels: usize) -> Self {
        let hidden = (3 * channels / 2).max(1);
        let inter_plane = KernelShape::new(3, 2 * channels);
        let inter_scale = KernelShape::new(3, channels);
        Self::new(channels, 4, [4, 4], [hidden, hidden], channels, inter_plane, inter_scale)
    }

    /// Random weights; see [`Start`] for the last layer.
    ///
    /// # Panics
    /// If the high-scale hyperprior is on without the two parts that it consists of, or groups do not divide channels.
    pub fn init(&self, device: &Device) -> ContextModel {
        let ContextParts { hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior } = self.parts;
        assert!(
            !high_scale_hyperprior || (hyperprior && inter_scale),
            "`high_scale_hyperprior` needs `hyperprior` and `inter_scale`"
        );
        let channels = self.channels;
        ContextModel {
            hyperprior: hyperprior
                .then(|| HyperpriorConfig::new(channels, self.hyper_channels, self.synthesis_channels).init(device)),
            checkerboard: checkerboard
                .then(|| CheckerboardConfig::new(channels).with_groups(self.context_groups).init(device)),
            inter_plane: inter_plane.then(|| {
                let KernelShape { kernel, groups } = self.inter_plane;
                InterPlaneConfig::new(channels).with_kernel(kernel).with_groups(groups).init(device)
            }),
            inter_scale: inter_scale.then(|| {
                let KernelShape { kernel, groups } = self.inter_scale;
                InterScaleConfig::new(channels).with_kernel(kernel).with_groups(groups).init(device)
            }),
            entropy_parameters: EntropyParametersConfig::new(channels, self.parameter_channels)
                .with_start(self.start.clone())
                .init(device),
            high_scale_hyperprior,
            space_only_center: self.space_only_center,
            space_time_center: self.space_time_center,
        }
    }
}

/// Bits of a plane.
#[derive(Clone, Debug)]
pub struct PlaneRate {
    /// Its place among all planes, scale-major.
    pub plane: usize,
    /// `[1]`: of its values.
    pub values_bits: Tensor<1>,
    /// `[1]`: of its hyperprior, where it has one.
    pub hyper_bits: Option<Tensor<1>>,
}

impl PlaneRate {
    /// `[1]`: values and hyperprior.
    pub fn total(self) -> Tensor<1> {
        match self.hyper_bits {
            Some(hyper) => self.values_bits + hyper,
            None => self.values_bits,
        }
    }
}

/// A plane as it comes out of the codec, but for rounding of floats.
#[derive(Clone, Debug)]
pub struct QuantizedPlane {
    /// What the decoder gets, `[M, H, W]`, original units.
    pub decoded: Tensor<3>,
    /// What is coded, `[M, H, W]`: integers.
    pub symbols: Tensor<3>,
    /// The plane's bits.
    pub rate: PlaneRate,
}

/// The context model. See the [module's documentation](self) for what it consists of.
///
/// Planes are `[M, H, W]`, scale-major, six a scale in the order of [`PLANE_NAMES`](light4gs_codec::plane_layout::PLANE_NAMES), H and W multiples
/// of 4, in original units. For training they carry uniform noise of their steps' width
/// ([`PlaneSteps::add_noise`]), and the parameters of a plane depend only on the noisy values of others, so a random
/// subset of planes gives an unbiased estimate of the rate.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_model::{ContextModelConfig, HexPlaneConfig, Latent, PlaneSteps};
///
/// let device = Device::flex();
/// let hexplane = HexPlaneConfig::new().with_channels(8).with_resolution([8, 8, 8, 4]).init(&device);
/// let model = ContextModelConfig::compact(8).init(&device);
/// let steps = PlaneSteps::fixed(&[0.1; 12], &device);
/// let planes: Vec<_> = hexplane.planes.iter().map(|plane| plane.val()).collect();
/// let rates = model.rate(&steps.add_noise(&planes), &steps, &[2, 6], Latent::Noise);
/// // A space-time plane of the lowest scale has a hyperprior, a plane above has none.
/// assert!(rates[0].hyper_bits.is_some() && rates[1].hyper_bits.is_none());
/// ```
#[derive(Module, Debug)]
pub struct ContextModel {
    /// `h_a`, `h_s` and the latent's bottleneck.
    pub hyperprior: Option<Hyperprior>,
    /// `context_prediction`.
    pub checkerboard: Option<Checkerboard>,
    /// `inter_plane`.
    pub inter_plane: Option<InterPlane>,
    /// `inter_scale`.
    pub inter_scale: Option<InterScale>,
    /// `entropy_parameters`.
    pub entropy_parameters: EntropyParameters,
    high_scale_hyperprior: bool,
    space_only_center: f64,
    space_time_center: f64,
}

impl ContextModel {
    /// The composition: for each plane the first part that applies gives its prior.
    pub fn parts(&self) -> Vec<Box<dyn PriorPart + '_>> {
        let mut parts: Vec<Box<dyn PriorPart>> = Vec::new();
        match (&self.hyperprior, &self.inter_scale) {
            (Some(hyperprior), Some(inter_scale)) if self.high_scale_hyperprior => {
                parts.push(Box::new(HighScaleHyperprior { hyperprior, inter_scale }));
            }
            (_, Some(inter_scale)) => parts.push(Box::new(inter_scale)),
            _ => {}
        }
        if let Some(inter_plane) = &self.inter_plane {
            parts.push(Box::new(inter_plane));
        }
        if let Some(hyperprior) = &self.hyperprior {
            parts.push(Box::new(hyperprior));
        }
        parts
    }

    /// What is subtracted from a plane before anything else.
    pub fn center_of(&self, plane: usize) -> f64 {
        if is_space_time(plane) { self.space_time_center } else { self.space_only_center }
    }

    /// Planes in original units as the parts see them.
    pub fn centered(&self, planes: &[Tensor<3>], steps: &PlaneSteps) -> CenteredPlanes {
        let planes = planes.iter().enumerate().map(|(i, plane)| plane.clone() - self.center_of(i)).collect();
        CenteredPlanes { planes, steps: steps.clone() }
    }

    /// Bits of the selected planes. The values are taken as they are: noisy in training, quantised in an evaluation.
    /// Differentiable in planes, steps and weights.
    pub fn rate(
        &self,
        planes: &[Tensor<3>],
        steps: &PlaneSteps,
        selection: &[usize],
        latent: Latent,
    ) -> Vec<PlaneRate> {
        let (planes, parts) = (self.centered(planes, steps), self.parts());
        selection.iter().map(|plane| self.rate_with(&parts, &planes, *plane, latent)).collect()
    }

    /// [`Self::rate`] of one plane with other parts than the model's own: for a composition with a part that this
    /// module does not know.
    pub fn rate_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &CenteredPlanes,
        plane: usize,
        latent: Latent,
    ) -> PlaneRate {
        let (gaussians, hyper_bits) = self.parameters_with(parts, planes, plane, latent);
        PlaneRate { plane, values_bits: value_bits(planes.in_steps(plane), gaussians).sum(), hyper_bits }
    }

    /// [`Self::plane_parameters`] of one plane with other parts than the model's own, and its hyperprior's bits.
    pub fn parameters_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &CenteredPlanes,
        plane: usize,
        latent: Latent,
    ) -> (NormalParameters<3>, Option<Tensor<1>>) {
        let prior = prior_of(parts, planes, plane, latent);
        let hyper_bits = prior.hyper_bits.clone();
        (self.gaussians(prior, &planes.planes[plane]), hyper_bits)
    }

    /// `[H, W]` for each selected plane: the bits of its values, summed over channels.
    pub fn bit_map(
        &self,
        planes: &[Tensor<3>],
        steps: &PlaneSteps,
        selection: &[usize],
        latent: Latent,
    ) -> Vec<Tensor<2>> {
        let centered = self.centered(planes, steps);
        let gaussians = self.plane_parameters(planes, steps, selection, latent);
        let maps = selection
            .iter()
            .zip(gaussians)
            .map(|(plane, gaussians)| value_bits(centered.in_steps(*plane), gaussians).sum_dim(0).squeeze_dim(0));
        maps.collect()
    }

    /// Means and scales of the selected planes' values, in units of their steps, relative to the centre.
    pub fn plane_parameters(
        &self,
        planes: &[Tensor<3>],
        steps: &PlaneSteps,
        selection: &[usize],
        latent: Latent,
    ) -> Vec<NormalParameters<3>> {
        let (planes, parts) = (self.centered(planes, steps), self.parts());
        selection.iter().map(|plane| self.parameters_with(&parts, &planes, *plane, latent).0).collect()
    }

    /// For each plane the symbols `[N, H / 4, W / 4]` of its hyperprior, where it has one. Call
    /// [`update_quantiles`](crate::EntropyBottleneck::update_quantiles) first, since they count from the medians.
    pub fn hyper_symbols(&self, planes: &[Tensor<3>], steps: &PlaneSteps) -> Vec<Option<Tensor<3>>> {
        let (planes, parts) = (self.centered(planes, steps), self.parts());
        let symbols = (0..planes.planes.len()).map(|plane| {
            let has_latent = prior_of(&parts, &planes, plane, Latent::Rounded).hyper_bits.is_some();
            let hyperprior = self.hyperprior.as_ref().filter(|_| has_latent)?;
            Some(hyperprior.symbols(planes.in_steps(plane)))
        });
        symbols.collect()
    }

    /// Quantises all planes in coding order, each with the parameters that the decoder will have: what the codec does,
    /// with a back end's floats in place of its exact executor. Without gradients.
    pub fn quantize(&self, planes: &[Tensor<3>], steps: &PlaneSteps) -> Vec<QuantizedPlane> {
        self.quantize_with(&self.parts(), planes, steps)
    }

    /// [`Self::quantize`] with other parts than the model's own.
    pub fn quantize_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &[Tensor<3>],
        steps: &PlaneSteps,
    ) -> Vec<QuantizedPlane> {
        let mut known = self.centered(planes, steps);
        for plane in &mut known.planes {
            *plane = plane.clone().detach();
        }
        let mut quantized: Vec<Option<QuantizedPlane>> = vec![None; planes.len()];
        for plane in coding_order(planes.len()) {
            let step = steps.broadcast(plane).detach();
            let prior = prior_of(parts, &known, plane, Latent::Rounded);
            let hyper_bits = prior.hyper_bits.clone();
            let values = known.in_steps(plane);
            let round = |means: Tensor<3>| ((values.clone() - means.clone()).round() + means) * step.clone();
            if let (Some(_), Passes::AnchorsFirst) = (&self.checkerboard, prior.passes) {
                // Only anchors are looked at by what follows.
                let [_, height, width] = values.dims();
                let anchors = Prior { passes: Passes::One, ..prior.clone() };
                let anchors = round(self.gaussians(anchors, &values).means);
                let mask = anchor_mask([height, width], &values.device());
                known.planes[plane] = anchors * mask;
            }
            let gaussians = self.gaussians(prior, &known.planes[plane]);
            let symbols = (values - gaussians.means.clone()).round();
            let received = symbols.clone() + gaussians.means.clone();
            let decoded = received.clone() * step;
            let rate = PlaneRate { plane, values_bits: value_bits(received, gaussians).sum(), hyper_bits };
            known.planes[plane] = decoded.clone();
            let decoded = decoded + self.center_of(plane);
            quantized[plane] = Some(QuantizedPlane { decoded, symbols, rate });
        }
        quantized.into_iter().map(|plane| plane.expect("the coding order visits every plane")).collect()
    }

    /// Starts the network at the statistics of these planes: each channel's mean and standard deviation over all
    /// planes, in steps, as the biases of the last layer. To be called when the rate enters a training that has begun
    /// without it; otherwise the values may lie so far in the Gaussians' tails that no gradient comes back.
    pub fn start_from(&mut self, planes: &[Tensor<3>], steps: &PlaneSteps) {
        let centered = self.centered(planes, steps);
        let channels = planes[0].dims()[0];
        let (mut sums, mut squares, mut count) = (vec![0.0f64; channels], vec![0.0f64; channels], 0usize);
        for plane in 0..planes.len() {
            let values: Vec<f64> = centered.in_steps(plane).into_data().iter::<f64>().collect();
            let length = values.len() / channels;
            for (channel, values) in values.chunks_exact(length).enumerate() {
                sums[channel] += values.iter().sum::<f64>();
                squares[channel] += values.iter().map(|v| v * v).sum::<f64>();
            }
            count += length;
        }
        let count = count as f64;
        let means: Vec<f32> = sums.iter().map(|sum| (sum / count) as f32).collect();
        let scales: Vec<f32> = sums
            .iter()
            .zip(&squares)
            .map(|(sum, squares)| (squares / count - (sum / count).powi(2)).max(0.0).sqrt().max(SMALLEST_START) as f32)
            .collect();
        self.entropy_parameters.start_from(&means, &scales);
    }

    /// Whether higher scales transmit a latent as well.
    pub fn has_high_scale_hyperprior(&self) -> bool {
        self.high_scale_hyperprior
    }

    /// Puts the hyperprior's quantiles where its densities have them; see
    /// [`EntropyBottleneck::update_quantiles`](crate::EntropyBottleneck::update_quantiles).
    pub fn update_quantiles(&mut self) {
        if let Some(hyperprior) = &mut self.hyperprior {
            hyperprior.bottleneck.update_quantiles();
        }
    }

    fn gaussians(&self, prior: Prior, plane: &Tensor<3>) -> NormalParameters<3> {
        let [_, height, width] = plane.dims();
        let context = match (&self.checkerboard, prior.passes) {
            (Some(checkerboard), Passes::AnchorsFirst) => Some(checkerboard.context(plane.clone())),
            _ => prior.context,
        };
        self.entropy_parameters.forward(prior.parameters, context, [height, width])
    }
}

/// A standard deviation, in steps, that a channel which does not vary at all starts with.
const SMALLEST_START: f64 = 0.3;

fn prior_of(parts: &[Box<dyn PriorPart + '_>], planes: &CenteredPlanes, plane: usize, latent: Latent) -> Prior {
    parts.iter().find_map(|part| part.prior(planes, plane, latent)).unwrap_or_else(Prior::constant)
}

fn value_bits(values: Tensor<3>, normal: NormalParameters<3>) -> Tensor<3> {
    bits(gaussian_likelihood(values, normal))
}
