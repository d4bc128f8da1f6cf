//! Adaptive quantization: learned steps (paper III-D; docs/design.md).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use light4gs_codec::plane_layout::{PlaneLayout, PlaneShape};
use light4gs_keys::{Bounds, keys};

use super::quantization_steps::{PlaneSteps, QUANTIZATION_STEP};

/// The coarsest step that the encoder takes.
const COARSEST: f64 = match QUANTIZATION_STEP {
    Bounds::Number { most, .. } => most,
    _ => panic!("the bounds of a number"),
};

keys! {
    /// The initial steps of an [`AdaptiveQuantization`].
    pub struct AdaptiveQuantizationConfig {
        /// Quantization step of the space-only planes at the start.
        space_only: f64 = 0.05; QUANTIZATION_STEP, "ours; reference: 0.1, fixed";
        /// Quantization step of the space-time planes at the start.
        space_time: f64 = 0.05; QUANTIZATION_STEP, "ours; reference: 0.1, fixed";
    }
}

impl AdaptiveQuantizationConfig {
    /// Steps of a layout's planes at their initial values.
    ///
    /// # Panics
    /// If a step is not positive and finite.
    pub fn init(&self, layout: &PlaneLayout, device: &Device) -> AdaptiveQuantization {
        let log_steps = Param::from_tensor(self.log_steps(device));
        AdaptiveQuantization { log_steps, layout: layout.clone() }
    }

    /// Logarithms of the initial steps, in the order of [`AdaptiveQuantization::log_steps`].
    fn log_steps(&self, device: &Device) -> Tensor<1> {
        let pair = [self.space_only, self.space_time];
        assert!(pair.iter().all(|step| *step > 0.0 && step.is_finite()), "steps must be positive, not {pair:?}");
        Tensor::from_floats(pair.map(|step| step.ln() as f32), device)
    }
}

/// A learned step for the space-only planes and one for the space-time planes.
///
/// The parameter is the logarithm. So a step is always positive, and an optimizer changes it by a ratio: a step of
/// 0.001 is learned as easily as one of 1.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
/// use light4gs_model::AdaptiveQuantizationConfig;
///
/// let planes = PlaneLayout::multiscale(&PlaneAxes::ALL, [8, 8, 8, 4], &[1, 2]);
/// let quantization = AdaptiveQuantizationConfig { space_time: 0.1, ..Default::default() }
///     .init(&planes, &Device::flex());
/// let steps = quantization.steps().values();
/// assert_eq!(steps.len(), 12);
/// assert!((steps[0] - 0.05).abs() < 1e-6 && (steps[2] - 0.1).abs() < 1e-6);
/// ```
#[derive(Module, Debug)]
pub struct AdaptiveQuantization {
    /// `[2]`: space-only, space-time.
    pub log_steps: Param<Tensor<1>>,
    #[module(skip)]
    layout: PlaneLayout,
}

impl AdaptiveQuantization {
    /// The step of every plane, with its gradient.
    pub fn steps(&self) -> PlaneSteps {
        self.steps_of(self.log_steps.val())
    }

    /// The step of every plane, computed without a tape. Operations on a tape that no backward pass reaches would stay
    /// there, and every later pass would search them.
    pub fn steps_without_gradient(&self) -> PlaneSteps {
        self.steps_of(self.log_steps.val().set_require_grad(false))
    }

    /// Resets steps that have become finer than the initial ones of `config` to those, and steps coarser than
    /// [`QUANTIZATION_STEP`] allows to the coarsest that it does.
    pub fn no_finer_than(&mut self, config: &AdaptiveQuantizationConfig) {
        let log_steps = self.log_steps.val().inner();
        let coarsest = COARSEST.ln();
        let bounded = if config.space_only == config.space_time {
            // One launch on a GPU.
            log_steps.clamp(config.space_only.ln(), coarsest)
        } else {
            let initial = config.log_steps(&log_steps.device());
            log_steps.max_pair(initial).clamp_max(coarsest)
        };
        let value = Tensor::from_inner(bounded);
        let learns = self.log_steps.is_require_grad();
        self.log_steps = Param::initialized(self.log_steps.id, value.set_require_grad(learns));
    }

    fn steps_of(&self, log_steps: Tensor<1>) -> PlaneSteps {
        let place = |plane: &PlaneShape| usize::from(plane.axes.is_space_time());
        PlaneSteps::shared(log_steps.exp(), self.layout.planes().iter().map(place).collect())
    }
}
