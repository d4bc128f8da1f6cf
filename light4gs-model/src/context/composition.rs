//! The interface of an entropy model of feature planes to training and coding: a [`ContextModel`], and further parts.

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
/// [`ContextModel`] is the paper's. A model with a part of your own holds a [`ContextModel`] and that part, returns the
/// first as its [`base`](Self::base), and adds its own part to the [`parts`](Self::parts); the other methods need no
/// change. Training finds the parameters of both, since a composition is a Burn module.
pub trait PlaneEntropy: Module + ModuleDisplay + 'static {
    /// The components that the parts share: centers, checkerboard, hyperprior, and the network that turns priors into
    /// distributions.
    fn base(&self) -> &ContextModel;

    /// [`Self::base`], for setting initial values and updating quantiles.
    fn base_mut(&mut self) -> &mut ContextModel;

    /// The parts: for each plane, the first part that applies gives its prior.
    fn parts(&self) -> Vec<Box<dyn PriorPart + '_>>;

    /// Bits of the selected planes. The values are used as given: noisy in training, quantized in an evaluation.
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

    /// Quantizes all planes in coding order, each with the parameters that the decoder will have: the same as the
    /// codec, but with the arithmetic of a back end in place of the exact executor. Without gradients.
    fn quantize(&self, planes: &PlaneTensors, steps: &PlaneSteps) -> Vec<QuantizedPlane> {
        self.base().quantize_with(&self.parts(), planes, steps)
    }

    /// For each plane that has a latent, its symbols `[N, H / 4, W / 4]`. Call
    /// [`update_quantiles`](ContextModel::update_quantiles) first, since symbols are relative to the medians.
    fn latent_symbols(&self, planes: &PlaneTensors, steps: &PlaneSteps) -> Vec<Option<Tensor<3>>> {
        self.base().latent_symbols_with(&self.parts(), planes, steps)
    }

    /// The data of the model that a decoder needs, for planes of a layout. Call
    /// [`update_quantiles`](ContextModel::update_quantiles) first: the hyperprior's tables extend to its quantiles.
    ///
    /// # Errors
    /// A density from which no frequency table can be made; the message says why.
    fn to_arrays(&self, layout: &PlaneLayout) -> Result<ContextModelArrays, CodecError> {
        self.base().to_arrays_with(&self.parts(), layout)
    }
}
