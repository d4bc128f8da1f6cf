//! A frame sampler in your own crate: a window of time that grows in the fine stage, so that motion is learned outwards
//! from the time at which the coarse stage has learned the scene.
//!
//! A [`FrameSampler`] says which frames an iteration uses. It has no state: the frames follow from the position in the
//! run, and random choices come from a generator that also follows from the position. So a resumed run uses the same
//! frames.

use std::path::Path;

use light4gs::data::Scene;
use light4gs::train::Stage;
use light4gs::train::config::Config;
use light4gs::train::dataset::load_options;
use light4gs::train::run::RunFolder;
use light4gs::train::sampling::{BatchRequest, FrameSampler};
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};
use rand::Rng;

/// Frames whose time is near `center`.
#[derive(Clone)]
struct GrowingWindow {
    /// In [0, 1], like all times.
    center: f32,
    /// Half the width of the window, in the coarse stage and at the start of the fine stage.
    half_width: f32,
    /// Share of the fine stage after which the window holds all times.
    until: f32,
    /// Share of the frames that are drawn from all times, so that no time is forgotten.
    everywhere: f32,
}

impl GrowingWindow {
    /// Half the width of the window in an iteration.
    fn half_width(&self, stage: Stage, iteration: usize, iterations: usize) -> f32 {
        let done = match stage {
            Stage::Coarse => 0.0,
            Stage::Fine => (iteration - 1) as f32 / (self.until * iterations as f32),
        };
        self.half_width + (1.0 - self.half_width) * done.min(1.0)
    }
}

impl FrameSampler for GrowingWindow {
    fn batch(&self, request: &BatchRequest) -> Vec<usize> {
        let half_width = self.half_width(request.stage, request.iteration, request.iterations);
        let all = &request.candidates.frames;
        let near = |frame: &usize| (request.frames[*frame].time - self.center).abs() <= half_width;
        let window: Vec<usize> = all.iter().copied().filter(near).collect();
        let mut random = request.generator(request.iteration);
        let mut draw = || {
            let wide = window.is_empty() || random.random::<f32>() < self.everywhere;
            let from = if wide { all } else { &window };
            from[random.random_range(0..from.len())]
        };
        (0..request.batch_size).map(|_| draw()).collect()
    }
}

/// Trains to the end, or for some steps only. Returns the frames that the trainer used, and its losses.
fn train(trainer: &mut Trainer, steps: usize) -> Outcome<Vec<(Stage, usize, usize, f32)>> {
    let mut seen = Vec::new();
    while seen.len() < steps
        && let Some(step) = trainer.step()?
    {
        seen.push((step.stage, step.iteration, step.frame, step.loss));
    }
    Ok(seen)
}

fn trainer(config: &Config, data: &Scene, folder: RunFolder, sampler: &GrowingWindow) -> Outcome<Trainer> {
    Ok(Trainer::builder(config.clone(), data.clone()).sampler(sampler.clone()).run_folder(folder).resume()?)
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    config.train.checkpoint_interval = 30;
    let scene = tiny_scene(folder.path())?;
    let data = Scene::open(&scene, &load_options(&config))?;
    let run = |name: &str| RunFolder::create(&folder.path().join(Path::new(name)), Some(&scene), &config, false);
    let window = GrowingWindow { center: 0.5, half_width: 0.2, until: 0.6, everywhere: 0.0 };

    // The whole run.
    let seen = train(&mut trainer(&config, &data, run("whole")?, &window)?, usize::MAX)?;
    let mut latest = 0.0f32;
    for (stage, iteration, frame, _) in &seen {
        let off = (data.train[*frame].time - window.center).abs();
        assert!(off <= window.half_width(*stage, *iteration, config.train.iterations(*stage)));
        latest = latest.max(off);
    }
    let losses: Vec<f32> = seen.iter().map(|(.., loss)| *loss).collect();
    let (first, last) = first_and_last(&losses);
    println!("times up to {latest:.2} from the center; loss {first:.3} at first, {last:.3} at last");
    assert!(latest > 0.4 && last < 0.7 * first);

    // Interrupted, and resumed from the last checkpoint: the same frames and the same losses, to the last bit.
    let begun = run("interrupted")?;
    train(&mut trainer(&config, &data, begun.clone(), &window)?, 75)?;
    let rest = train(&mut trainer(&config, &data, begun, &window)?, usize::MAX)?;
    println!("resumed after {} of {} iterations", seen.len() - rest.len(), seen.len());
    assert!(rest.len() < seen.len() && seen.ends_with(&rest));

    // A function is a sampler too. A sampler that names no frame is refused.
    let first_frame = |request: &BatchRequest| vec![request.candidates.frames[0]];
    let mut short = Trainer::builder(config.clone(), data.clone()).sampler(first_frame).build()?;
    assert!(short.step()?.is_some_and(|step| step.frame == 0));
    let nothing = |_: &BatchRequest| Vec::new();
    let error = Trainer::builder(config, data).sampler(nothing).build()?.step().unwrap_err();
    println!("{error}");
    Ok(())
}
