//! A regularizer in your own crate: Gaussians should not be needles. Where the longest axis is more than a few times
//! the shortest, the excess is added to the loss.
//!
//! A [`Regularizer`] gets the scene, with its parameters on the tape, and returns one number, or nothing in iterations
//! that it leaves out. The trainer adds the number to the loss, beside the regularizers of planes and field.

use burn::tensor::Tensor;
use light4gs::data::Scene;
use light4gs::model::{DeformationField, DynamicScene};
use light4gs::train::dataset::load_options;
use light4gs::train::regularizer::{Regularizer, RegularizerInput};
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};

/// Mean over the Gaussians of `max(0, ratio of longest to shortest axis - limit)`.
struct Roundness {
    /// Ratio up to which there is no penalty.
    limit: f32,
    weight: f32,
}

/// `[N, 1]`: logarithms of the ratios of longest to shortest axis.
fn log_ratios<F: DeformationField>(scene: &DynamicScene<F>) -> Tensor<2> {
    let log_scales = scene.gaussians.log_scales.val();
    log_scales.clone().max_dim(1) - log_scales.min_dim(1)
}

impl<F: DeformationField> Regularizer<F> for Roundness {
    fn loss(&self, input: RegularizerInput<F>) -> Option<Tensor<1>> {
        let excess = (log_ratios(input.scene) - self.limit.ln()).clamp_min(0.0);
        Some(excess.mean() * self.weight)
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let config = tiny_config()?;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;
    let excess =
        |trainer: &Trainer| (log_ratios(trainer.scene()) - 1.2f32.ln()).clamp_min(0.0).mean().into_scalar::<f32>();

    // The same run twice, with the term and without.
    let mut plain = Trainer::builder(config.clone(), data.clone()).build()?;
    while plain.step()?.is_some() {}
    let mut round = Trainer::builder(config, data).regularizer(Roundness { limit: 1.2, weight: 0.1 }).build()?;
    let mut losses = Vec::new();
    while let Some(step) = round.step()? {
        losses.push(step.loss);
    }
    let (first, last) = first_and_last(&losses);
    let (with, without) = (excess(&round), excess(&plain));
    println!(
        "excess {with:.4} with the regularizer, {without:.4} without; loss {first:.3} at first, {last:.3} at last"
    );
    assert!(last < 0.7 * first && with < 0.5 * without);
    Ok(())
}
