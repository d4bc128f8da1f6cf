//! A densification strategy of one's own: the number of Gaussians never changes, but those that nobody can see are moved
//! to where opaque ones are (the idea of 3DGS-MCMC, Kheradmand et al. 2024, in its simplest form).
//!
//! A [`DensityStrategy`] is asked after every backward pass and after every step of the optimizer. It changes the Gaussians
//! through a [`GaussianEditor`], which keeps the optimizer's moments in line with the rows.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Tensor};
use light4gs_data::Scene;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};
use light4gs_train::Stage;
use light4gs_train::dataset::load_options;
use light4gs_train::density::{DensityStrategy, GaussianEditor, TrainingPosition, ViewStatistics};
use light4gs_train::trainer::Trainer;
use rand::Rng;

/// Every so many iterations, Gaussians of less than this opacity are moved.
const INTERVAL: usize = 20;
const TOO_FAINT: f32 = 0.05;
/// Nothing is moved after this iteration of a stage.
const UNTIL: usize = 80;

/// Counts what it moves, so that a run can be watched from outside.
#[derive(Default)]
struct Relocation {
    moved: Arc<AtomicUsize>,
}

impl DensityStrategy for Relocation {
    fn begin_stage(&mut self, _count: usize, _device: &Device) {}

    // Opacities say enough; a strategy that needs gradients of screen positions gathers them here.
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
        // Each faint one becomes a copy of an opaque one, drawn at random. The generator of the position makes a resumed run
        // draw the same.
        let mut generator = position.generator();
        let copies = faint.iter().map(|_| opaque[generator.random_range(0..opaque.len())]);
        let rows: Vec<usize> = opaque.iter().copied().chain(copies).collect();
        // The first rows keep their moments, the copies begin without.
        gaussians.select_rows(&rows, opaque.len());
        self.moved.fetch_add(faint.len(), Ordering::Relaxed);
    }

    // Pruning by significance has dropped rows: nothing here is kept by row.
    fn rows_kept(&mut self, _keep: &[bool]) {}

    fn is_over(&self, _stage: Stage, iteration: usize) -> bool {
        iteration > UNTIL
    }

    // What a checkpoint must hold: the count, so that a resumed run reports the same.
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

fn main() -> Outcome {
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

    // What it would tell a checkpoint is what it takes back.
    let saved = Relocation { moved: Arc::new(AtomicUsize::new(moved)) }.state();
    let mut restored = Relocation::default();
    restored.restore(saved, count)?;
    assert_eq!(restored.moved.load(Ordering::Relaxed), moved);
    Ok(())
}
