//! One Adam step (Kingma and Ba, 2015): its numbers and its tensors.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// Numbers of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamStep {
    /// Learning rate of this step.
    pub learning_rate: f32,
    /// Decay of the first moment.
    pub beta_1: f64,
    /// Decay of the second moment.
    pub beta_2: f64,
    /// Added to the root of the second moment after bias correction.
    pub epsilon: f32,
    /// Steps that this parameter has taken, this one included (so at least 1).
    pub time: u32,
}

impl AdamStep {
    /// Learning rate over the first moment's bias correction.
    pub(crate) fn corrected_learning_rate(&self) -> f32 {
        (f64::from(self.learning_rate) / (1.0 - self.beta_1.powi(self.time as i32))) as f32
    }

    /// Root of the second moment's bias correction.
    pub(crate) fn root_correction(&self) -> f32 {
        (1.0 - self.beta_2.powi(self.time as i32)).sqrt() as f32
    }
}

/// A parameter with its moments.
#[derive(ExtensionType)]
pub struct AdamTensors<B: Backend> {
    /// The parameter, any shape.
    pub parameter: FloatTensor<B>,
    /// First moment, in the parameter's shape.
    pub first_moment: FloatTensor<B>,
    /// Second moment, in the parameter's shape.
    pub second_moment: FloatTensor<B>,
}
