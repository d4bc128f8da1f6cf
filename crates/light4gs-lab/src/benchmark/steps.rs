//! Timing of the trainer's own step, and of rendering: for every deformation field with every loss, without and with
//! noise and rate.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_data::{Frame, PointCloud, RgbImage32, Scene, SplitFrames};
use light4gs_model::{GaussianTensors, Splatter};
use light4gs_train::Stage;
use light4gs_train::config::Config;
use light4gs_train::dataset::MemoryImages;
use light4gs_train::density::{DensityStrategy, GaussianEditor, TrainingPosition, ViewStatistics};
use light4gs_train::error::TrainError;
use light4gs_train::loss::LossKind;
use light4gs_train::trainer::Trainer;

use super::{BenchScene, Cost, Meter, Timing};

/// The fields, each with the preset whose steps are timed and the changes to it.
pub(super) const FIELDS: [TimedField; 3] = [
    TimedField { name: "hexplane", preset: "hexplane-dnerf-cpu", keys: &[] },
    TimedField { name: "nodes", preset: "dnerf+medium", keys: &[] },
    TimedField { name: "still", preset: "hexplane-dnerf-cpu", keys: &["model.field=still"] },
];

/// Frames that are trained on, each at a time of its own.
const FRAMES: usize = 8;
/// The time at which a trained scene is rendered.
const TIME: f32 = 0.3;

/// Every iteration is like the one before: one view at full size, all degrees of the harmonics, no Gaussian added or
/// dropped, and an end that is far away.
const STEADY: [&str; 13] = [
    "train.coarse_iterations=1",
    "train.fine_iterations=1000000",
    "train.batch_size=1",
    "train.sampling=shuffled",
    "train.sh_degree_interval=1",
    "train.log_interval=1000000",
    "train.photometric.l2_until=0",
    "train.coarse_to_fine.quarter_until=0",
    "train.coarse_to_fine.half_until=0",
    "train.prune.fraction=0",
    "train.guided_sampling.iterations=[]",
    "eval.interval=0",
    "compression.rate.lambda=0",
];

/// Entropy models and learned steps, but hardly an iteration with a rate: the median does not see one in a thousand.
const NOISE: [&str; 5] = [
    "compression.rate.lambda=0.05",
    "compression.rate.from=1",
    "compression.rate.planes_until=0",
    "compression.rate.interval=1000",
    "compression.steps.adaptive_from=0",
];

/// On top of [`NOISE`]: every iteration has a rate.
const RATE: &str = "compression.rate.interval=1";

/// A deformation field whose steps are timed.
#[derive(Debug)]
pub(super) struct TimedField {
    name: &'static str,
    preset: &'static str,
    keys: &'static [&'static str],
}

impl TimedField {
    /// The name of a row about the field.
    pub(super) fn row(&self, part: &str) -> String {
        format!("{}, {part}", self.name)
    }

    fn config(&self, keys: &[&str]) -> Result<Config, TrainError> {
        let keys: Vec<String> = STEADY.iter().chain(self.keys).chain(keys).map(|key| (*key).to_owned()).collect();
        Ok(Config::load(self.preset, &keys)?)
    }

    /// Times a plain step, and one with noise and rate, on a scene's Gaussians.
    pub(super) fn steps(&self, scene: &BenchScene, meter: &Meter) -> Result<[Timing; 2], TrainError> {
        let time = |part: &str, keys: &[&str]| {
            Ok::<_, TrainError>(Timing { name: self.row(part), cost: step_with(scene, self.config(keys)?, meter)? })
        };
        Ok([time("training step", &[])?, time("step with noise and rate", &[NOISE.as_slice(), &[RATE]].concat())?])
    }

    /// Times the steps with the field on a scene's Gaussians.
    pub(super) fn timings(
        &self,
        scene: &BenchScene,
        meter: &Meter,
        add: &mut impl FnMut(String, Cost),
    ) -> Result<(), TrainError> {
        let config = self.config(&[])?;
        let usual = config.train.loss;
        let mut trainer = trainer(scene, config, meter.device)?;
        let step = step(&mut trainer, meter)?;
        add(self.row("Adam step"), adam(&mut trainer, meter)?);
        add(self.row("training step"), step);
        let render = render(scene, &trainer, meter);
        drop(trainer);

        let time = |keys: &[&str]| step_with(scene, self.config(keys)?, meter);
        for loss in LossKind::NAMES.iter().filter(|loss| **loss != usual.name()) {
            add(self.row(&format!("step with {loss} loss")), time(&[&format!("train.loss={loss}")])?);
        }
        add(self.row("step with noise"), time(&NOISE)?);
        add(self.row("step with noise and rate"), time(&[NOISE.as_slice(), &[RATE]].concat())?);
        add(self.row("render"), render);
        Ok(())
    }
}

/// The cost of a step of a new trainer.
fn step_with(scene: &BenchScene, config: Config, meter: &Meter) -> Result<Cost, TrainError> {
    step(&mut trainer(scene, config, meter.device)?, meter)
}

/// The cost of a step.
fn step(trainer: &mut Trainer, meter: &Meter) -> Result<Cost, TrainError> {
    let mut failed = None;
    let cost = meter.measure(|| (), |()| failed = failed.take().or(trainer.step().err()));
    failed.map_or(Ok(cost), Err)
}

/// The time of the optimizer in a step, by the trainer's profile. Its launches are among those of the step.
fn adam(trainer: &mut Trainer, meter: &Meter) -> Result<Cost, TrainError> {
    trainer.measure_stages();
    while trainer.profile().laps("Adam").len() < meter.repeats {
        trainer.step()?;
    }
    let seconds = super::median_of(trainer.profile().laps("Adam"));
    Ok(Cost { milliseconds: 1e3 * seconds, launches: BTreeMap::new(), read_backs: 0, read_bytes: 0 })
}

/// The cost of an image of the trained scene.
fn render(scene: &BenchScene, trainer: &Trainer, meter: &Meter) -> Cost {
    let splatter = Splatter::new(scene.background, trainer.config().model.sh_degree.into());
    let trained = trainer.scene().valid();
    let mut frame = 0;
    let draw = |()| {
        frame += 1;
        splatter.render(trained.at(TIME), &scene.camera_at(frame), None).image
    };
    meter.measure(|| (), draw)
}

/// A trainer in its fine stage, whose Gaussians are those of the scene. Its frames show them as they are, so that they hardly
/// change while they are trained.
fn trainer(scene: &BenchScene, config: Config, device: &Device) -> Result<Trainer, TrainError> {
    let still = scene.gaussians(device).tensors();
    let sh_rest = still.sh_rest.clone().narrow(1, 0, (usize::from(config.model.sh_degree) + 1).pow(2) - 1);
    let still = GaussianTensors { sh_rest, ..still };
    let splatter = Splatter::new(scene.background, config.model.sh_degree.into());
    let frames: Vec<Frame> = (0..FRAMES)
        .map(|k| Frame::without_image(k.to_string(), scene.camera_at(k), k as f32 / (FRAMES - 1) as f32))
        .collect();
    let image = |frame: &Frame| {
        let pixels = splatter.render(still.clone(), &frame.camera, None).image.into_data().iter::<f32>().collect();
        let image = RgbImage32 { width: frame.camera.width, height: frame.camera.height, pixels };
        (frame.name.clone(), image.to_u8())
    };
    let images: MemoryImages = frames.iter().map(image).collect();
    let positions = scene.means.as_chunks::<3>().0.to_vec();
    let cloud = PointCloud { colors: vec![[0.5; 3]; positions.len()], positions };
    let frames = SplitFrames { test: frames[..1].to_vec(), train: frames, ..SplitFrames::default() };
    let data = Scene::new("memory", Path::new(&scene.name), frames, cloud, scene.background)?;
    let given = GivenGaussians(Some(still));
    let builder = Trainer::builder(config, data).device(device.clone()).images(images).density(given);
    let mut trainer = builder.build()?;
    // The coarse stage's only iteration.
    trainer.step()?;
    Ok(trainer)
}

/// Gaussians that replace those of the cloud after the first iteration. Afterwards none is added or removed.
struct GivenGaussians(Option<GaussianTensors>);

impl DensityStrategy for GivenGaussians {
    fn begin_stage(&mut self, _: usize, _: &Device) {}

    fn after_backward(&mut self, _: &[ViewStatistics], _: &TrainingPosition) {}

    fn after_step(&mut self, gaussians: &mut GaussianEditor, _: &TrainingPosition) {
        if let Some(given) = self.0.take() {
            gaussians.update(|own| GaussianTensors { further: own.further, ..given });
        }
    }

    fn rows_kept(&mut self, _: &[bool]) {}

    fn is_over(&self, _: Stage, _: usize) -> bool {
        true
    }

    fn state(&self) -> BTreeMap<String, Tensor<1>> {
        BTreeMap::new()
    }

    fn restore(&mut self, _: BTreeMap<String, Tensor<1>>, _: usize) -> Result<(), String> {
        Ok(())
    }
}
