//! What a part of the context model contributes to a plane, and what it may look at.

use burn::tensor::Tensor;
use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs_codec::{Network, PlaneSource};

use crate::entropy::bottleneck::Latent;
use crate::entropy::quantization_steps::PlaneSteps;
use crate::planes::PlaneTensors;

/// All planes `[M, H, W]` of a field minus their groups' centers, with their steps.
///
/// For the planes that are coded before, these are the decoded ones, or the noisy ones that stand for them in training. Only a
/// hyperprior looks at the plane that is being coded: it is transmitted.
#[derive(Clone, Debug)]
pub struct CenteredPlanes {
    /// `[M, H, W]`, original units minus the center.
    pub planes: PlaneTensors,
    /// One for each plane.
    pub steps: PlaneSteps,
}

impl CenteredPlanes {
    /// A plane in units of its step, `[M, H, W]`.
    pub fn in_steps(&self, plane: usize) -> Tensor<3> {
        self.planes[plane].clone() / self.steps.broadcast(plane)
    }

    /// Which planes there are.
    pub fn layout(&self) -> &PlaneLayout {
        self.planes.layout()
    }

    /// The plane over the same axes one scale below; none where there is none.
    pub fn one_scale_below(&self, plane: usize) -> Option<Tensor<3>> {
        Some(self.planes[self.layout().one_scale_below(plane)?].clone())
    }

    /// The plane over other axes in the same scale as `plane`; none where there is none.
    pub fn in_same_scale(&self, plane: usize, axes: PlaneAxes) -> Option<Tensor<3>> {
        Some(self.planes[self.layout().in_same_scale(plane, axes)?].clone())
    }
}

/// In which order the values of a plane are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    /// All at once.
    One,
    /// The checkerboard's anchors, then the others with them as context, if the model has a checkerboard.
    AnchorsFirst,
}

/// Where the Gaussian parameters of a plane come from. Absent tensors count as zeros.
#[derive(Clone, Debug)]
pub struct Prior {
    /// `[2 M, H, W]`.
    pub parameters: Option<Tensor<3>>,
    /// `[2 M, H, W]`, in the place of the checkerboard's context; only with [`Passes::One`].
    pub context: Option<Tensor<3>>,
    /// How the values are coded.
    pub passes: Passes,
    /// `[1]`: what is transmitted beside the values.
    pub latent_bits: Option<Tensor<1>>,
}

impl Prior {
    /// Nothing is known but the network's biases.
    pub fn constant() -> Self {
        Self { parameters: None, context: None, passes: Passes::AnchorsFirst, latent_bits: None }
    }
}

/// A part of the context model.
///
/// A model is a list of parts. For each plane the first part that has something to say gives its prior, so an ablation is a
/// shorter list, and a new part is one more entry.
pub trait PriorPart {
    /// The prior of a plane, or nothing where this part does not apply.
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior>;

    /// The same for the codec's exact executor, with the same weights: what [`PriorPart::prior`] computes for a plane of such
    /// a layout, in the same order. Both apply to the same planes.
    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior>;
}

/// A [`Prior`] as networks. Absent ones count as zeros.
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

/// A network of one output and what it reads.
#[derive(Clone, Debug)]
pub struct DescribedCondition {
    /// To `[2 M, H, W]`.
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
