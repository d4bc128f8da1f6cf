//! Quantization steps of the planes, and quantization noise.

use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::checks::LEAST_STEP;
use light4gs_keys::Bounds;

use crate::planes::PlaneTensors;

/// The bounds of a key that is a quantization step: those of the encoder.
pub const QUANTIZATION_STEP: Bounds = Bounds::Number { least: LEAST_STEP as f64, most: 1e3 };

/// A step for each plane, in the order of the planes. Learned steps have a gradient.
#[derive(Clone, Debug)]
pub struct PlaneSteps(Vec<Tensor<1>>);

impl PlaneSteps {
    /// From tensors `[1]`, one for each plane.
    pub fn new(steps: Vec<Tensor<1>>) -> Self {
        Self(steps)
    }

    /// Fixed steps.
    pub fn fixed(steps: &[f32], device: &Device) -> Self {
        Self(steps.iter().map(|step| Tensor::from_floats([*step], device)).collect())
    }

    /// The same steps, detached: as leaves of a new tape if they are `learned`, otherwise without a tape.
    pub fn leaves(&self, learned: bool) -> Self {
        Self(self.0.iter().map(|step| step.clone().detach().set_require_grad(learned)).collect())
    }

    /// A plane's step, `[1]`.
    pub fn of(&self, plane: usize) -> Tensor<1> {
        self.0[plane].clone()
    }

    /// A plane's step, to multiply or divide planes with: `[1, 1, 1]`.
    pub fn broadcast(&self, plane: usize) -> Tensor<3> {
        self.of(plane).unsqueeze()
    }

    /// As numbers.
    pub fn values(&self) -> Vec<f32> {
        self.0.iter().map(|step| step.clone().into_scalar::<f32>()).collect()
    }

    /// Planes with uniform noise as wide as their steps, which stands in for rounding during training. The steps'
    /// gradient passes through the noise.
    pub fn add_noise(&self, planes: &PlaneTensors) -> PlaneTensors {
        planes.map(|place, plane| {
            let noise = Tensor::random(plane.dims(), Distribution::Uniform(-0.5, 0.5), &plane.device());
            plane + noise * self.broadcast(place)
        })
    }
}
