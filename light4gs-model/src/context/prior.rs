//! What a part of the context model contributes to a plane, and what it may look at.

use burn::tensor::Tensor;

use crate::entropy::bottleneck::Latent;
use crate::entropy::quantization_steps::PlaneSteps;
use crate::scene::hexplane::{PLANE_NAMES, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};

const PLANES: usize = PLANE_NAMES.len();

/// All planes `[M, H, W]` of a hexplane, scale-major, minus their groups' centres, with their steps.
///
/// For the planes that are coded before, these are the decoded ones, or the noisy ones that stand for them in training. Only a
/// hyperprior looks at the plane that is being coded: it is transmitted.
#[derive(Clone, Debug)]
pub struct CenteredPlanes {
    /// `[M, H, W]`, original units minus the centre.
    pub planes: Vec<Tensor<3>>,
    /// One for each plane.
    pub steps: PlaneSteps,
}

impl CenteredPlanes {
    /// The scale of a plane, 0 the lowest.
    pub fn scale_of(plane: usize) -> usize {
        plane / PLANES
    }

    /// Whether a plane holds time.
    pub fn is_space_time(plane: usize) -> bool {
        SPACE_TIME_PLANES.contains(&(plane % PLANES))
    }

    /// A plane in units of its step, `[M, H, W]`.
    pub fn in_steps(&self, plane: usize) -> Tensor<3> {
        self.planes[plane].clone() / self.steps.broadcast(plane)
    }

    /// The plane over the same axes one scale below; none for the lowest scale.
    pub fn one_scale_below(&self, plane: usize) -> Option<Tensor<3>> {
        Some(self.planes[plane.checked_sub(PLANES)?].clone())
    }

    /// The plane at a position of [`PLANE_NAMES`] in the same scale as `plane`.
    pub fn in_same_scale(&self, plane: usize, position: usize) -> Tensor<3> {
        self.planes[Self::scale_of(plane) * PLANES + position].clone()
    }
}

/// The order in which planes are coded: scale by scale, in each the space-time planes first.
pub fn coding_order(planes: usize) -> Vec<usize> {
    let scales = 0..planes / PLANES;
    let in_scale = SPACE_TIME_PLANES.into_iter().chain(SPACE_ONLY_PLANES);
    scales.flat_map(|scale| in_scale.clone().map(move |position| scale * PLANES + position)).collect()
}

/// In which order the values of a plane are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    /// All at once.
    One,
    /// The checkerboard's anchors, then the others in sight of them, if the model has a checkerboard.
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
    pub hyper_bits: Option<Tensor<1>>,
}

impl Prior {
    /// Nothing is known but the network's biases.
    pub fn constant() -> Self {
        Self { parameters: None, context: None, passes: Passes::AnchorsFirst, hyper_bits: None }
    }
}

/// A part of the context model.
///
/// A model is a list of parts. For each plane the first part that has something to say gives its prior, so an ablation is a
/// shorter list, and a new part is one more entry.
pub trait PriorPart {
    /// The prior of a plane, or nothing where this part does not apply.
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior>;
}

impl<P: PriorPart> PriorPart for &P {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, latent: Latent) -> Option<Prior> {
        (**self).prior(planes, plane, latent)
    }
}
