//! Quantization steps of the planes, and quantization noise.

use burn::tensor::{Device, Tensor};
use light4gs_codec::checks::LEAST_STEP;
use light4gs_keys::Bounds;

use crate::ops::uniform_noise::{NoiseDraw, add_uniform_noise};
use crate::planes::PlaneTensors;
use crate::tape::off_tape;

/// The bounds of a key that is a quantization step: those of the encoder.
pub const QUANTIZATION_STEP: Bounds = Bounds::Number { least: LEAST_STEP as f64, most: 1e3 };

/// A step for each plane, in the order of the planes; several planes may share one. Learned steps have a gradient.
#[derive(Clone, Debug)]
pub struct PlaneSteps {
    /// `[S]`.
    steps: Tensor<1>,
    /// The place of each plane's step.
    places: Vec<usize>,
}

impl PlaneSteps {
    /// From steps `[S]` and the place of each plane's among them.
    ///
    /// # Panics
    /// If a plane has a place that does not exist.
    pub fn shared(steps: Tensor<1>, places: Vec<usize>) -> Self {
        let count = steps.dims()[0];
        assert!(places.iter().all(|place| *place < count), "places among {count} steps: {places:?}");
        Self { steps, places }
    }

    /// Fixed steps, one for each plane.
    pub fn fixed(steps: &[f32], device: &Device) -> Self {
        Self::shared(Tensor::from_floats(steps, device), (0..steps.len()).collect())
    }

    /// The same steps, detached: as leaves of a new tape if they are `learned`, otherwise without a tape.
    pub fn leaves(&self, learned: bool) -> Self {
        let steps = self.steps.clone().detach().set_require_grad(learned);
        Self { steps, places: self.places.clone() }
    }

    /// `[S]`: the steps without repetitions.
    pub fn steps(&self) -> Tensor<1> {
        self.steps.clone()
    }

    /// A plane's step, `[1]`.
    pub fn of(&self, plane: usize) -> Tensor<1> {
        self.steps.clone().narrow(0, self.places[plane], 1)
    }

    /// A plane's step, to multiply or divide planes with: `[1, 1, 1]`.
    pub fn broadcast(&self, plane: usize) -> Tensor<3> {
        self.of(plane).unsqueeze()
    }

    /// As numbers, one for each plane.
    pub fn values(&self) -> Vec<f32> {
        let steps: Vec<f32> = self.steps.clone().into_data().iter().collect();
        self.places.iter().map(|place| steps[*place]).collect()
    }

    /// From a number for each plane, `[P]`, to the sum over the planes of each step, `[S]`.
    pub fn sums_over_planes(&self, of_planes: Tensor<1>) -> Tensor<1> {
        let [steps] = self.steps.dims();
        let mut shares = vec![0.0f32; self.places.len() * steps];
        self.places.iter().enumerate().for_each(|(plane, place)| shares[plane * steps + place] = 1.0);
        let shares = Tensor::<1>::from_floats(shares.as_slice(), &of_planes.device());
        of_planes.unsqueeze::<2>().matmul(shares.reshape([self.places.len(), steps])).squeeze_dim(0)
    }

    /// Planes with uniform noise as wide as their steps, which stands in for rounding during training. The same seed gives the same
    /// noise. The result is on no tape; [`noise_gradient`](crate::ops::noise_gradient::noise_gradient) is the derivative by the
    /// logarithms of the steps.
    pub fn add_noise(&self, planes: &PlaneTensors, seed: u64) -> PlaneTensors {
        let draw = |plane: usize| {
            // Backwards from the seed: those of the attributes go forwards.
            let seed = seed.wrapping_sub((plane as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            NoiseDraw { width: self.places[plane], in_units: false, seed }
        };
        let values = planes.iter().map(|plane| off_tape(plane.clone()).reshape([-1])).collect();
        let steps = off_tape(self.steps.clone());
        let unit = Tensor::from_floats([1.0], &steps.device());
        let noisy = add_uniform_noise(values, steps, unit, (0..planes.len()).map(draw).collect());
        planes.map(|place, plane| {
            let noisy = noisy[place].clone().reshape(plane.dims());
            if plane.device().is_autodiff() { Tensor::from_inner(noisy) } else { noisy }
        })
    }
}
