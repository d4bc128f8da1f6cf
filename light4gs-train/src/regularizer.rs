//! Regularizers from other crates: terms of the loss over the scene, which do not depend on the views of an iteration.
//!
//! Regularizers of the feature planes are built in (`train.regularizer`), and a deformation field may have its own.

use burn::tensor::Tensor;
use light4gs_model::{DeformationField, DynamicScene};

use crate::stage::Stage;

/// The scene before a step, and the training position.
#[derive(Debug)]
pub struct RegularizerInput<'a, F: DeformationField> {
    /// Its parameters are on the tape, without quantization noise.
    pub scene: &'a DynamicScene<F>,
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1.
    pub iteration: usize,
    /// Iterations of the stage.
    pub iterations: usize,
}

impl<F: DeformationField> Clone for RegularizerInput<'_, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F: DeformationField> Copy for RegularizerInput<'_, F> {}

/// A differentiable term of the loss over a scene.
pub trait Regularizer<F: DeformationField>: Send {
    /// `[1]`, weighted, on the tape of the scene's parameters; `None` to leave it out of this iteration.
    fn loss(&self, input: RegularizerInput<F>) -> Option<Tensor<1>>;
}

/// A function is a regularizer.
impl<F: DeformationField, R: Fn(RegularizerInput<F>) -> Option<Tensor<1>> + Send> Regularizer<F> for R {
    fn loss(&self, input: RegularizerInput<F>) -> Option<Tensor<1>> {
        self(input)
    }
}
