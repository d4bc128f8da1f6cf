//! A densification strategy in your own crate: the number of Gaussians never changes, but Gaussians that cannot be seen
//! are moved to opaque ones (the idea of 3DGS-MCMC, Kheradmand et al. 2024, in its simplest form).
//!
//! A [`DensityStrategy`] is called after every backward pass and after every step of the optimizer. It changes the
//! Gaussians through a [`GaussianEditor`], which changes the rows of the optimizer's moments in the same way.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Tensor};
use light4gs::data::Scene;
use light4gs::train::Stage;
use light4gs::train::dataset::load_options;
use light4gs::train::density::{DensityStrategy, GaussianEditor, TrainingPosition, ViewStatistics};
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};
use rand::Rng;

/// Iterations between two moves of the Gaussians whose opacity is below `TOO_FAINT`.
const INTERVAL: usize = 20;
const TOO_FAINT: f32 = 0.05;
/// Nothing is moved after this iteration of a stage.
const UNTIL: usize = 80;

/// Counts the moved Gaussians, so that a run can be watched from outside.
#[derive(Default)]
struct Relocation {
    moved: Arc<AtomicUsize>,
}

impl DensityStrategy for Relocation {
    fn begin_stage(&mut self, _count: usize, _device: &Device) {}

    // This strategy needs only opacities. One that needs gradients of screen positions collects them here.
    fn after_backward(&mut self, _views: &[ViewStatistics], _position: &TrainingPosition) {}

    fn after_step(&mut self, gaussians: &mut GaussianEditor, position: &TrainingPosition) {
        if !position.iteration.is_multiple_of(INTERVAL) || self.is_over(position.stage, position.iteration) {
            return;
        }
        let logits = gaussians.gaussians().opacity_logits.val().inner();
        let opacities: Vec<f32> = sigmoid(logits).into_data().iter::<f32>().collect();
        let (opaque, faint): (Vec<usize>, Vec<usize>) = (0..opacities.len()).partition(|&i| opacities[i] >= TOO_FAINT);
        if opaque.is_empty() || faint.is_empty() {
            return;
        }
        // Each faint Gaussian becomes a copy of an opaque one, drawn at random. With the generator of the position a
        // resumed run draws the same ones.
        let mut generator = position.generator();
        let copies = faint.iter().map(|_| opaque[generator.random_range(0..opaque.len())]);
        let rows: Vec<usize> = opaque.iter().copied().chain(copies).collect();
        // The first rows keep their moments; those of the copies are zero.
        gaussians.select_rows(&rows, opaque.len());
        self.moved.fetch_add(faint.len(), Ordering::Relaxed);
    }

    // Pruning by significance has removed rows. This strategy stores nothing for each row.
    fn rows_kept(&mut self, _keep: &[bool]) {}

    fn is_over(&self, _stage: Stage, iteration: usize) -> bool {
        iteration > UNTIL
    }

    // State that a checkpoint must have: the count, so that a resumed run reports the same number.
    fn state(&self) -> BTreeMap<String, Tensor<1>> {
        let moved = self.moved.load(Ordering::Relaxed) as f32;
        BTreeMap::from([("moved".to_owned(), Tensor::from_floats([moved], &Device::flex()))])
    }

    fn restore(&mut self, mut state: BTreeMap<String, Tensor<1>>, _count: usize) -> Result<(), String> {
        let moved = state.remove("moved").ok_or("`moved` is missing")?;
        self.moved.store(moved.into_scalar::<f32>() as usize, Ordering::Relaxed);
        Ok(())
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let config = tiny_config()?;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;
    let count = data.points.len();

    let strategy = Relocation::default();
    let moved = Arc::clone(&strategy.moved);
    let mut trainer = Trainer::builder(config, data).density(strategy).build()?;
    let mut losses = Vec::new();
    while let Some(step) = trainer.step()? {
        assert_eq!(step.gaussians, count, "their number does not change");
        losses.push(step.loss);
    }
    let moved = moved.load(Ordering::Relaxed);
    let (first, last) = first_and_last(&losses);
    println!("{moved} Gaussians moved, {count} all the time; loss {first:.3} at first, {last:.3} at last");
    assert!(moved > 0 && last < 0.7 * first);

    // The state for a checkpoint is the state that `restore` accepts.
    let saved = Relocation { moved: Arc::new(AtomicUsize::new(moved)) }.state();
    let mut restored = Relocation::default();
    restored.restore(saved, count)?;
    assert_eq!(restored.moved.load(Ordering::Relaxed), moved);
    Ok(())
}
