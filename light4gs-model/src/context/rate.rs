//! The bits of planes under a context model, and planes as the codec quantizes them.

use burn::tensor::Tensor;
use light4gs_codec::plane_layout::PlaneAxes;

use super::ContextModel;
use super::checkerboard::anchor_mask;
use super::prior::{CenteredPlanes, Passes, Prior, PriorPart};
use crate::entropy::bottleneck::Latent;
use crate::entropy::gaussian_conditional::{NormalParameters, gaussian_bits};
use crate::entropy::quantization_steps::PlaneSteps;
use crate::planes::PlaneTensors;

/// Bits of a plane.
#[derive(Clone, Debug)]
pub struct PlaneRate {
    /// Its index among all planes.
    pub plane: usize,
    /// `[1]`: of its values.
    pub values_bits: Tensor<1>,
    /// `[1]`: of its latent, if it has one.
    pub latent_bits: Option<Tensor<1>>,
}

impl PlaneRate {
    /// `[1]`: values and latent.
    pub fn total(self) -> Tensor<1> {
        match self.latent_bits {
            Some(hyper) => self.values_bits + hyper,
            None => self.values_bits,
        }
    }
}

/// A plane as the codec decodes it, except for rounding of floats.
#[derive(Clone, Debug)]
pub struct QuantizedPlane {
    /// The decoded plane, `[M, H, W]`, original units.
    pub decoded: Tensor<3>,
    /// The symbols, `[M, H, W]`: integers.
    pub symbols: Tensor<3>,
    /// The plane's bits.
    pub rate: PlaneRate,
}

impl ContextModel {
    /// The center that is subtracted from planes over these axes.
    pub fn center_of(&self, axes: PlaneAxes) -> f64 {
        if axes.is_space_time() { self.space_time_center } else { self.space_only_center }
    }

    /// From planes in original units to the input of the parts.
    pub fn centered(&self, planes: &PlaneTensors, steps: &PlaneSteps) -> CenteredPlanes {
        let centers = planes.layout().planes().iter().map(|plane| self.center_of(plane.axes)).collect();
        CenteredPlanes::new(planes.clone(), centers, steps.clone())
    }

    /// Bits of a plane under a composition of parts.
    pub fn rate_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &CenteredPlanes,
        plane: usize,
        latent: Latent,
    ) -> PlaneRate {
        let (gaussians, latent_bits) = self.parameters_with(parts, planes, plane, latent);
        PlaneRate { plane, values_bits: gaussian_bits(planes.in_steps(plane), gaussians).sum(), latent_bits }
    }

    /// Means and scales of a plane's values under a composition of parts, in units of the plane's step and relative to its
    /// center, and the bits of its latent.
    pub fn parameters_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &CenteredPlanes,
        plane: usize,
        latent: Latent,
    ) -> (NormalParameters<3>, Option<Tensor<1>>) {
        let prior = prior_of(parts, planes, plane, latent);
        let latent_bits = prior.latent_bits.clone();
        (self.gaussians(prior, planes, plane), latent_bits)
    }

    /// `[H, W]`: the bits of a plane's values under a composition of parts, summed over channels.
    pub fn bit_map_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &CenteredPlanes,
        plane: usize,
        latent: Latent,
    ) -> Tensor<2> {
        let (gaussians, _) = self.parameters_with(parts, planes, plane, latent);
        gaussian_bits(planes.in_steps(plane), gaussians).sum_dim(0).squeeze_dim(0)
    }

    /// For each plane that has a latent under a composition of parts, the latent's symbols `[N, H / 4, W / 4]`.
    pub fn latent_symbols_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &PlaneTensors,
        steps: &PlaneSteps,
    ) -> Vec<Option<Tensor<3>>> {
        let planes = self.centered(planes, steps);
        let symbols = (0..planes.layout().len()).map(|plane| {
            let has_latent = prior_of(parts, &planes, plane, Latent::Rounded).latent_bits.is_some();
            let hyperprior = self.hyperprior.as_ref().filter(|_| has_latent)?;
            Some(hyperprior.symbols(planes.in_steps(plane)))
        });
        symbols.collect()
    }

    /// Quantizes all planes in coding order under a composition of parts, each with the parameters that the decoder will
    /// have. Without gradients.
    pub fn quantize_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        planes: &PlaneTensors,
        steps: &PlaneSteps,
    ) -> Vec<QuantizedPlane> {
        let mut known = self.centered(&planes.map(|_, plane| plane.detach()), steps);
        let mut quantized: Vec<Option<QuantizedPlane>> = vec![None; planes.len()];
        for plane in planes.layout().coding_order() {
            let step = steps.broadcast(plane).detach();
            let prior = prior_of(parts, &known, plane, Latent::Rounded);
            let latent_bits = prior.latent_bits.clone();
            let values = known.in_steps(plane);
            let round = |means: Tensor<3>| ((values.clone() - means.clone()).round() + means) * step.clone();
            if let (Some(_), Passes::AnchorsFirst) = (&self.checkerboard, prior.passes) {
                // The checkerboard reads only anchors.
                let [_, height, width] = values.dims();
                let anchors = Prior { passes: Passes::One, ..prior.clone() };
                let anchors = round(self.gaussians(anchors, &known, plane).means());
                let mask = anchor_mask([height, width], &values.device());
                known.set(plane, anchors * mask);
            }
            let gaussians = self.gaussians(prior, &known, plane);
            let means = gaussians.means();
            let symbols = (values - means.clone()).round();
            let received = symbols.clone() + means;
            let decoded = received.clone() * step;
            let rate = PlaneRate { plane, values_bits: gaussian_bits(received, gaussians).sum(), latent_bits };
            known.set(plane, decoded.clone());
            let decoded = decoded + self.center_of(planes.layout().planes()[plane].axes);
            quantized[plane] = Some(QuantizedPlane { decoded, symbols, rate });
        }
        quantized.into_iter().map(|plane| plane.expect("the coding order visits every plane")).collect()
    }

    /// Initializes the network with the statistics of these planes: each channel's mean and standard deviation over all
    /// planes, in steps, become the biases of the last layer. Call it when the rate is added to a training that has
    /// begun without it. Otherwise the values may lie so far in the Gaussians' tails that gradients vanish.
    pub fn start_from(&mut self, planes: &PlaneTensors, steps: &PlaneSteps) {
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

    /// Sets the hyperprior's quantiles to those of its densities; see
    /// [`EntropyBottleneck::update_quantiles`](crate::EntropyBottleneck::update_quantiles).
    pub fn update_quantiles(&mut self) {
        if let Some(hyperprior) = &mut self.hyperprior {
            hyperprior.bottleneck.update_quantiles();
        }
    }

    fn gaussians(&self, prior: Prior, planes: &CenteredPlanes, plane: usize) -> NormalParameters<3> {
        let [height, width] = planes.layout().planes()[plane].size;
        let context = match (&self.checkerboard, prior.passes) {
            (Some(checkerboard), Passes::AnchorsFirst) => Some(checkerboard.context(planes.plane(plane))),
            _ => prior.context,
        };
        self.entropy_parameters.forward(prior.parameters, context, [height, width])
    }
}

/// Least initial standard deviation, in steps, for a channel that does not vary.
const SMALLEST_START: f64 = 0.3;

fn prior_of(parts: &[Box<dyn PriorPart + '_>], planes: &CenteredPlanes, plane: usize, latent: Latent) -> Prior {
    parts.iter().find_map(|part| part.prior(planes, plane, latent)).unwrap_or_else(Prior::constant)
}
