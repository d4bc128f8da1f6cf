//! The interface of a part of the context model: the planes that it may read, and the prior that it computes.

use std::cell::OnceCell;

use burn::tensor::Tensor;
use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs_codec::{Network, PlaneSource};

use crate::entropy::bottleneck::Latent;
use crate::entropy::quantization_steps::PlaneSteps;
use crate::planes::PlaneTensors;

/// All planes `[M, H, W]` of a field, their centers, which are subtracted when a plane is asked for, and their steps.
///
/// Planes that are coded before are given as decoded, or, in training, with noise. Only a hyperprior reads the plane
/// that is being coded, since its latent is transmitted.
#[derive(Clone, Debug)]
pub struct CenteredPlanes {
    planes: PlaneTensors,
    centers: Vec<f64>,
    steps: PlaneSteps,
    computed: Vec<Computed>,
}

/// What has been asked for of a plane: its operations, which have gradients, are recorded once.
#[derive(Clone, Debug, Default)]
struct Computed {
    centered: OnceCell<Tensor<3>>,
    in_steps: OnceCell<Tensor<3>>,
}

impl CenteredPlanes {
    /// Planes in original units, the center of each, and their steps.
    ///
    /// # Panics
    /// If there is not one center for each plane.
    pub fn new(planes: PlaneTensors, centers: Vec<f64>, steps: PlaneSteps) -> Self {
        assert_eq!(centers.len(), planes.len(), "a center for each plane");
        let computed = vec![Computed::default(); planes.len()];
        Self { planes, centers, steps, computed }
    }

    /// A plane with its center subtracted, `[M, H, W]`, original units.
    pub fn plane(&self, plane: usize) -> Tensor<3> {
        let centered = self.computed[plane].centered.get_or_init(|| {
            let values = self.planes[plane].clone();
            // Subtracting nothing would be a launch on a GPU.
            if self.centers[plane] == 0.0 { values } else { values - self.centers[plane] }
        });
        centered.clone()
    }

    /// Replaces a plane by values with the center subtracted.
    pub(super) fn set(&mut self, plane: usize, centered: Tensor<3>) {
        self.planes.set(plane, centered);
        self.centers[plane] = 0.0;
        self.computed[plane] = Computed::default();
    }

    /// The planes' steps.
    pub fn steps(&self) -> &PlaneSteps {
        &self.steps
    }

    /// A plane in units of its step, `[M, H, W]`.
    pub fn in_steps(&self, plane: usize) -> Tensor<3> {
        let in_steps = self.computed[plane].in_steps.get_or_init(|| {
            let values = self.plane(plane);
            let shape = values.dims();
            // As a vector: the sum for the gradient of the step then has one axis.
            (values.reshape([-1]) / self.steps.of(plane)).reshape(shape)
        });
        in_steps.clone()
    }

    /// The layout of the planes.
    pub fn layout(&self) -> &PlaneLayout {
        self.planes.layout()
    }

    /// The plane `[M, h, w]` over the same axes one scale below, if there is one, in original units with the center
    /// subtracted.
    pub fn one_scale_below(&self, plane: usize) -> Option<Tensor<3>> {
        Some(self.plane(self.layout().one_scale_below(plane)?))
    }

    /// The plane `[M, H, W]` over other axes in the same scale as `plane`, if there is one, in original units with the center
    /// subtracted.
    pub fn in_same_scale(&self, plane: usize, axes: PlaneAxes) -> Option<Tensor<3>> {
        Some(self.plane(self.layout().in_same_scale(plane, axes)?))
    }
}

/// The order in which the values of a plane are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    /// All at once.
    One,
    /// The checkerboard's anchors, then the others with them as context, if the model has a checkerboard.
    AnchorsFirst,
}

/// The input of the network that gives a plane's Gaussians. `None` means zeros.
#[derive(Clone, Debug)]
pub struct Prior {
    /// `[2 M, H, W]`.
    pub parameters: Option<Tensor<3>>,
    /// `[2 M, H, W]`, in place of the checkerboard's context; only with [`Passes::One`].
    pub context: Option<Tensor<3>>,
    /// How the values are coded.
    pub passes: Passes,
    /// `[1]`: bits that are coded besides the values.
    pub latent_bits: Option<Tensor<1>>,
}

impl Prior {
    /// No information: the distribution comes from the network's biases alone.
    pub fn constant() -> Self {
        Self { parameters: None, context: None, passes: Passes::AnchorsFirst, latent_bits: None }
    }
}

/// A part of the context model.
///
/// A model is a list of parts. For each plane, the first part that applies gives its prior. So an ablation is a shorter
/// list, and a new part is one more entry.
pub trait PriorPart {
    /// The prior of a plane, or `None` if this part does not apply.
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior>;

    /// The same for the codec's exact executor, with the same weights: the computation of [`PriorPart::prior`] for a
    /// plane of such a layout, in the same order. Both must apply to the same planes.
    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior>;
}

/// A [`Prior`] as networks. `None` means zeros.
#[derive(Clone, Debug)]
pub struct DescribedPrior {
    /// Gives [`Prior::parameters`].
    pub parameters: Option<DescribedCondition>,
    /// Gives [`Prior::context`].
    pub context: Option<DescribedCondition>,
    /// How the values are coded.
    pub passes: Passes,
}

impl DescribedPrior {
    /// [`Prior::constant`].
    pub fn constant() -> Self {
        Self { parameters: None, context: None, passes: Passes::AnchorsFirst }
    }
}

/// A network with one output, and its inputs.
#[derive(Clone, Debug)]
pub struct DescribedCondition {
    /// Its output is `[2 M, H, W]`.
    pub network: Network,
    /// One for each input of the network.
    pub sources: Vec<PlaneSource>,
}

impl<P: PriorPart> PriorPart for &P {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior> {
        (**self).prior(planes, plane, latent)
    }

    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        (**self).describe(layout, plane)
    }
}
