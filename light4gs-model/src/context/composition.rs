//! What training and coding ask of an entropy model of feature planes: a [`ContextModel`], and the parts around it.

use burn::module::{Module, ModuleDisplay};
use burn::tensor::Tensor;
use light4gs_codec::plane_layout::PlaneLayout;
use light4gs_codec::{CodecError, ContextModelArrays};

use super::ContextModel;
use super::prior::PriorPart;
use super::rate::{PlaneRate, QuantizedPlane};
use crate::entropy::bottleneck::Latent;
use crate::entropy::gaussian_conditional::NormalParameters;
use crate::entropy::quantization_steps::PlaneSteps;
use crate::planes::PlaneTensors;

/// An entropy model of feature planes as a composition of parts (paper III-C).
///
/// [`ContextModel`] is the paper's. A model with a part of one's own holds a [`ContextModel`] and the part, names the
/// first as its [`base`](Self::base), and lists its own part among the [`parts`](Self::parts); the rest follows. Training
/// finds the parameters of both, since a composition is a Burn module.
pub trait PlaneEntropy: Module + ModuleDisplay + 'static {
    /// What the parts share: centers, checkerboard, hyperprior, and the network that turns priors into distributions.
    fn base(&self) -> &ContextModel;

    /// [`Self::base`], to start and to finish it.
    fn base_mut(&mut self) -> &mut ContextModel;

    /// The composition: for each plane the first part that applies gives its prior.
    fn parts(&self) -> Vec<Box<dyn PriorPart + '_>>;

    /// Bits of the selected planes. The values are taken as they are: noisy in training, quantized in an evaluation.
    /// Differentiable in planes, steps and weights.
    fn rate(&self, planes: &PlaneTensors, steps: &PlaneSteps, selection: &[usize], latent: Latent) -> Vec<PlaneRate> {
        let (planes, parts) = (self.base().centered(planes, steps), self.parts());
        selection.iter().map(|plane| self.base().rate_with(&parts, &planes, *plane, latent)).collect()
    }

    /// `[H, W]` for each selected plane: the bits of its values, summed over channels.
    fn bit_map(
        &self,
        planes: &PlaneTensors,
        steps: &PlaneSteps,
        selection: &[usize],
        latent: Latent,
    ) -> Vec<Tensor<2>> {
        let (planes, parts) = (self.base().centered(planes, steps), self.parts());
        selection.iter().map(|plane| self.base().bit_map_with(&parts, &planes, *plane, latent)).collect()
    }

    /// Means and scales of the selected planes' values, in units of their steps, relative to the center.
    fn plane_parameters(
        &self,
        planes: &PlaneTensors,
        steps: &PlaneSteps,
        selection: &[usize],
        latent: Latent,
    ) -> Vec<NormalParameters<3>> {
        let (planes, parts) = (self.base().centered(planes, steps), self.parts());
        selection.iter().map(|plane| self.base().parameters_with(&parts, &planes, *plane, latent).0).collect()
    }

    /// Quantizes all planes in coding order, each with the parameters that the decoder will have: what the codec does,
    /// with a back end's floats in place of its exact executor. Without gradients.
    fn quantize(&self, planes: &PlaneTensors, steps: &PlaneSteps) -> Vec<QuantizedPlane> {
        self.base().quantize_with(&self.parts(), planes, steps)
    }

    /// For each plane the symbols `[N, H / 4, W / 4]` of its latent, where it has one. Call
    /// [`update_quantiles`](ContextModel::update_quantiles) first, since they count from the medians.
    fn latent_symbols(&self, planes: &PlaneTensors, steps: &PlaneSteps) -> Vec<Option<Tensor<3>>> {
        self.base().latent_symbols_with(&self.parts(), planes, steps)
    }

    /// What a decoder needs of the model for planes of a layout. Call [`update_quantiles`](ContextModel::update_quantiles) first: the hyperprior's
    /// tables go as far as its quantiles.
    ///
    /// # Errors
    /// A density that gives no frequency table; the message names what is wrong with it.
    fn to_arrays(&self, layout: &PlaneLayout) -> Result<ContextModelArrays, CodecError> {
        self.base().to_arrays_with(&self.parts(), layout)
    }
}
