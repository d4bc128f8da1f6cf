//! A significance score in your own crate: the share of a pixel that a Gaussian fills, on average over the pixels that
//! it touches.
//!
//! A [`SignificanceScore`] gets the contributions of each Gaussian to the training views, and returns one number for
//! each. The trainer removes the share of Gaussians with the smallest numbers.

use std::sync::{Arc, Mutex};

use light4gs::data::Scene;
use light4gs::train::Stage;
use light4gs::train::dataset::load_options;
use light4gs::train::density::{GaussianContributions, SignificanceScore};
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, tiny_config, tiny_scene};

/// Mean blending weight over the pixels of a Gaussian: many faint pixels count less than a few opaque ones. Keeps the
/// scores that it has returned, so that `main` can look at them.
#[derive(Clone, Default)]
struct MeanWeight {
    given: Arc<Mutex<Vec<Vec<f64>>>>,
}

impl SignificanceScore for MeanWeight {
    fn scores(&self, contributions: &GaussianContributions) -> Vec<f64> {
        let pairs = contributions.blending_weight.iter().zip(&contributions.pixels);
        let scores: Vec<f64> = pairs.map(|(weight, pixels)| weight / pixels.max(1.0)).collect();
        self.given.lock().expect("nobody panics with the lock").push(scores.clone());
        scores
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    // Cloning ends at iteration 60; at 80 a pass of pruning drops 30 % of the Gaussians.
    config.train.prune.fraction = 0.3;
    assert_eq!(
        (config.train.densify.strategies.adaptive.until, config.train.prune.iterations.as_slice()),
        (60, [80].as_slice())
    );
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;

    let score = MeanWeight::default();
    let mut trainer = Trainer::builder(config, data).significance(score.clone()).build()?;
    let (mut before, mut after) = (0, 0);
    while let Some(step) = trainer.step()? {
        if step.stage == Stage::Fine {
            match step.iteration {
                79 => before = step.gaussians,
                80 => after = step.gaussians,
                _ => {}
            }
        }
    }

    // One pass, one score for each Gaussian, each a mean weight in [0, 1].
    let given = score.given.lock().expect("nobody panics with the lock");
    assert_eq!(given.len(), 1);
    assert_eq!(given[0].len(), before);
    assert!(given[0].iter().all(|score| (0.0..=1.0).contains(score)));
    println!("{before} Gaussians before pruning by mean weight, {after} after");
    let share = after as f64 / before as f64;
    assert!((share - 0.7).abs() < 0.01, "{share} of the Gaussians are left");
    Ok(())
}
