//! Regularizers from outside: terms of the loss over the scene, whatever the views of an iteration are.
//!
//! Those of the feature planes are built in (`train.regularizer`), and a deformation field brings its own.

use burn::tensor::Tensor;
use light4gs_model::{DeformationField, DynamicScene};

use crate::stage::Stage;

/// The scene before a step, and where the run stands.
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

/// A differentiable measure of what is wrong with a scene.
pub trait Regularizer<F: DeformationField>: Send {
    /// `[1]`, with its weight, on the tape of the scene's parameters; none where it has nothing to say in this iteration.
    fn loss(&self, input: RegularizerInput<F>) -> Option<Tensor<1>>;
}

/// A function is a regularizer.
impl<F: DeformationField, R: Fn(RegularizerInput<F>) -> Option<Tensor<1>> + Send> Regularizer<F> for R {
    fn loss(&self, input: RegularizerInput<F>) -> Option<Tensor<1>> {
        self(input)
    }
}
