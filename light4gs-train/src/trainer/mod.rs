//! The training loop: a coarse stage without motion, then a fine stage with the deformation field (paper IV-B).
//!
//! - this file: [`Trainer`], with [`Trainer::step`] and [`Trainer::run`]
//! - `builder`: the parts of a trainer
//! - `step`: one iteration
//! - `motion`: calls to the deformation field other than moving the Gaussians
//! - `views`: the views of an iteration, each with its own tape
//! - `list_room`: room for the splats of an image, so that a GPU is not waited for
//! - `learning_rates`: the rate of each parameter group
//! - `rate`: quantization noise, and the rate in the loss
//! - `file_so_far`: the file as it stands, encoded for what follows it:
//!   - `rate_correction`: the expected bits of attributes follow those that the coder writes
//!   - `rate_steering`: the weight of the rate, where the file shall have a certain size or quality
//! - `pruning`: pruning by significance
//!
//! The parts that a researcher may want to replace are traits: [`Loss`], [`FrameSampler`], [`Regularizer`],
//! [`DensityStrategy`], [`SignificanceScore`], [`Observer`] and [`ImageSource`].

mod background;
mod builder;
mod file_so_far;
mod guided_sampling;
mod learning_rates;
mod list_room;
mod motion;
pub mod profile;
mod pruning;
mod rate;
pub(crate) mod rate_correction;
mod rate_steering;
mod step;
mod views;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_data::{Frame, Scene, Split};
use light4gs_model::{Backdrop, BuiltInField, DeformationField, DynamicScene, GaussianTensors, Splatter};

pub use builder::TrainerBuilder;

use crate::compression::{CodedScene, CompressionOf, ConfiguredModels, EntropyModels, TrainedScene, code_scene};
use crate::config::Config;
use crate::corrections::Corrections;
use crate::dataset::ImageSource;
use crate::density::{DensityStrategy, SignificanceScore};
use crate::divergence::{Divergence, EmptyImageWatch, NotFinite, not_finite_in, remedy, unusual_key};
use crate::error::TrainError;
use crate::loss::Loss;
use crate::metrics::{image_tensor, psnr};
use crate::observers::metrics_log::MetricsRecord;
use crate::observers::{Observer, SceneInTraining, StepReport};
use crate::optimization::adam::Adam;
use crate::regularizer::Regularizer;
use crate::run::{Checkpoint, RunFolder, SaveError, checkpoint_name, list_checkpoints};
use crate::sampling::{CandidateFrames, FrameSampler};
use crate::stage::Stage;
use background::Background;
use list_room::ListRoom;
use profile::Profile;
use views::{NoOffsets, ViewPools};

/// A run in progress.
///
/// Without a run folder everything stays in memory, and there are no checkpoints or logs. Ten iterations with a custom
/// loss, on images in memory:
///
/// ```
/// use std::path::Path;
///
/// use light4gs_data::{Camera, Frame, PointCloud, RgbImage8, Scene, SplitFrames};
/// use light4gs_train::config::{Config, DeviceName};
/// use light4gs_train::loss::LossInput;
/// use light4gs_train::dataset::MemoryImages;
/// use light4gs_train::trainer::Trainer;
///
/// // Four views of an orange ball's silhouette, at four times.
/// let image = |_| {
///     let inside = |i: i32| (i % 32 - 16).pow(2) + (i / 32 - 16).pow(2) < 64;
///     let pixels = (0..32 * 32).flat_map(|i| if inside(i) { [255, 128, 0] } else { [255; 3] }).collect();
///     RgbImage8 { width: 32, height: 32, pixels }
/// };
/// let frames: Vec<Frame> = (0..4)
///     .map(|k| {
///         let (sin, cos) = (k as f32 * 1.57).sin_cos();
///         let eye = [4.0 * cos, 4.0 * sin, 0.5].into();
///         let camera = Camera::look_at(eye, [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 32, 32);
///         Frame::without_image(format!("view-{k}"), camera, k as f32 / 3.0)
///     })
///     .collect();
/// let images: MemoryImages = frames.iter().map(|frame| (frame.name.clone(), image(frame))).collect();
/// let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
/// let data = Scene::new("memory", Path::new("ball"), frames, PointCloud::random(200, 0.8, 0), [1.0; 3])?;
///
/// let mut config = Config::from_preset("hexplane-dnerf-cpu")?;
/// config.device = DeviceName::Flex;
/// config.train.coarse_iterations = 5;
/// config.train.fine_iterations = 5;
/// config.train.prune.fraction = 0.0;
/// let mut trainer = Trainer::builder(config, data)
///     .images(images)
///     // The square root of the squared difference, smoothed: less strict than L2, more than L1.
///     .loss(|view: LossInput| ((view.image - view.truth).powi_scalar(2) + 1e-4).sqrt().mean())
///     .build()?;
/// let mut losses = Vec::new();
/// while let Some(step) = trainer.step()? {
///     losses.push(step.loss);
/// }
/// assert_eq!(losses.len(), 10);
/// # Ok::<(), light4gs_train::error::TrainError>(())
/// ```
pub struct Trainer<F: DeformationField = BuiltInField, E: EntropyModels = ConfiguredModels> {
    config: Config,
    device: Device,
    data: Scene,
    images: Box<dyn ImageSource>,
    folder: Option<RunFolder>,
    state: Checkpoint<F, E>,
    models: E,
    loss: Box<dyn Loss>,
    corrections: Corrections,
    backdrop: Option<Backdrop>,
    density: Box<dyn DensityStrategy>,
    significance: Box<dyn SignificanceScore>,
    observers: Vec<Box<dyn Observer>>,
    stop: Arc<AtomicBool>,
    sampler: Box<dyn FrameSampler>,
    candidates: CandidateFrames,
    regularizers: Vec<Box<dyn Regularizer<F>>>,
    profile: Profile,
    view_pools: ViewPools,
    list_room: ListRoom,
    offsets: NoOffsets,
    background: Background,
    lap: Option<Lap>,
    empty_images: EmptyImageWatch,
}

/// When the measurement of the speed began; `None` before a stage has begun.
#[derive(Clone, Copy)]
struct Lap {
    begin: Instant,
    iteration: usize,
}

impl Trainer {
    /// A builder for a run of `config` on `data`. The defaults are the parts that `config` names.
    pub fn builder(config: Config, data: Scene) -> TrainerBuilder {
        let field = config.model.field();
        Self::builder_with_field(config, data, field)
    }
}

impl<F: DeformationField> Trainer<F> {
    /// The same with a deformation field of your own: `field` replaces `model.hexplane` and `model.deformation` of the
    /// configuration.
    pub fn builder_with_field(config: Config, data: Scene, field: F::Config) -> TrainerBuilder<F> {
        TrainerBuilder::new(config, data, field)
    }
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Measures the parts of every iteration from now on. The run becomes slower, since it waits for the end of each
    /// part.
    pub fn measure_stages(&mut self) {
        self.profile = Profile::on(&self.device);
        // Parts can be measured only one after the other.
        self.view_pools = ViewPools::none();
    }

    /// The times since [`Trainer::measure_stages`].
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The dataset.
    pub fn data(&self) -> &Scene {
        &self.data
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The model as trained so far, on the run's device.
    pub fn scene(&self) -> &DynamicScene<F> {
        &self.state.scene
    }

    /// The corrections of exposures, poses and times, as learned so far.
    pub fn corrections(&self) -> &Corrections {
        &self.corrections
    }

    /// Entropy models and quantization steps, where the run trains them.
    pub fn compression(&self) -> Option<&CompressionOf<E>> {
        self.state.compression.as_ref()
    }

    /// Stage of the next iteration, or of the last one if training is over, and iterations done in it.
    pub fn position(&self) -> (Stage, usize) {
        (self.state.stage, self.state.iteration)
    }

    /// Seconds of training so far, over all sessions.
    pub fn seconds(&self) -> f64 {
        self.state.seconds
    }

    /// Trains to the end. With a run folder, also writes `scene.l4gs` and the record of its coding, and returns the
    /// file's size in bytes.
    ///
    /// # Errors
    /// As [`Trainer::step`] and [`Trainer::encode`].
    pub fn run(&mut self) -> Result<Option<u64>, TrainError> {
        while self.step()?.is_some() {}
        let Some(folder) = self.folder.clone() else { return Ok(None) };
        let coded = self.encode()?;
        folder.write("scene.l4gs", &coded.bytes)?;
        if let Some(record) = self.corrections.record() {
            folder.write_json("corrections.json", &record)?;
        }
        if let Some((record, bit_maps)) = &coded.coding {
            folder.write_json("coding.json", record)?;
            folder.write_json("bit_maps.json", bit_maps)?;
        }
        Ok(Some(coded.bytes.len() as u64))
    }

    /// The current scene as the bytes of a `.l4gs` file, in the profile of the configuration. If the run trains no
    /// entropy models, they are fitted first.
    ///
    /// # Errors
    /// As [`code_scene`]; [`TrainError::Stopped`] if that was requested; the error of an observer.
    pub fn encode(&mut self) -> Result<CodedScene, TrainError> {
        let trained = TrainedScene {
            scene: &self.state.scene,
            compression: self.state.compression.as_ref(),
            models: &self.models,
            config: &self.config,
            data: &self.data,
            images: Some(&*self.images),
            backdrop: self.backdrop.as_ref(),
            device: &self.device,
        };
        let (observers, stop, folder) = (&mut self.observers, &self.stop, self.folder.as_ref());
        let coded = code_scene(&trained, &mut |done, iterations| match stop.load(Ordering::Relaxed) {
            true => Err(stopped("while the entropy models were fitted", folder)),
            false => observers.iter_mut().try_for_each(|observer| observer.on_fit(done, iterations)),
        });
        coded.map_err(|error| match error {
            // Only here is it known from which run to continue.
            TrainError::Diverged(fit) => self.diverged(fit.stage, fit.iteration, fit.found),
            other => other,
        })
    }

    /// One iteration: forward and backward passes over a batch of views, the optimizer's step, then cloning, splitting
    /// and pruning where they are due. It also writes metrics and checkpoints, and changes the stage. Returns a report,
    /// or `None` once training is over.
    ///
    /// # Errors
    /// [`TrainError::Diverged`] if the loss or a parameter is not finite; an image that cannot be read; a log or a
    /// checkpoint that cannot be written; the error of an observer; [`TrainError::Stopped`] if that was requested.
    pub fn step(&mut self) -> Result<Option<StepReport>, TrainError> {
        let Some(iterations) = self.begin_iteration()? else { return Ok(None) };
        if self.stop.load(Ordering::Relaxed) {
            return Err(self.stop()?);
        }
        let stage = self.state.stage;
        let iteration = self.state.iteration + 1;
        let begin = Instant::now();
        let mut report = self.optimize(stage, iteration)?;
        self.control_density(stage, iteration);
        if stage == Stage::Fine {
            self.follow_file(iteration)?;
        }
        if stage == Stage::Fine && self.config.train.guided_sampling.is_due(iteration) {
            self.sample_guided(iteration)?;
        }
        self.state.iteration = iteration;
        self.state.seconds += begin.elapsed().as_secs_f64();
        report.gaussians = self.state.scene.gaussians.len();
        report.seconds = self.state.seconds;
        let scene = Snapshot { scene: &self.state.scene, stage };
        self.observers.iter_mut().try_for_each(|observer| observer.on_step(&report, &scene))?;

        let is_last = iteration == iterations;
        if iteration.is_multiple_of(self.config.train.log_interval) || is_last {
            self.log(&report, is_last)?;
        }
        let interval = self.config.train.checkpoint_interval;
        if (interval > 0 && iteration.is_multiple_of(interval)) || is_last {
            self.save_checkpoint()?;
        }
        if is_last {
            self.lap = None;
            self.observers.iter_mut().try_for_each(|observer| observer.on_stage_end(stage))?;
        }
        Ok(Some(report))
    }

    /// The length of the current stage; if a stage is over, that of the next one, to which it changes. `None` at the
    /// end of training.
    fn begin_iteration(&mut self) -> Result<Option<usize>, TrainError> {
        if self.state.stage == Stage::Coarse && self.state.iteration >= self.config.train.coarse_iterations {
            self.begin_fine_stage();
        }
        let (stage, done) = (self.state.stage, self.state.iteration);
        let iterations = self.config.train.iterations(stage);
        if done >= iterations {
            return Ok(None);
        }
        if self.lap.is_none() {
            self.observers.iter_mut().try_for_each(|observer| observer.on_stage(stage, done, iterations))?;
            self.restart_lap();
        }
        Ok(Some(iterations))
    }

    /// Makes sure that the state is saved, and returns the error that says where training has stopped.
    fn stop(&mut self) -> Result<TrainError, TrainError> {
        let (stage, iteration) = self.position();
        let saved = |folder: &RunFolder| folder.checkpoints().join(checkpoint_name(stage, iteration)).exists();
        // At the beginning of a stage everything is in the last checkpoint, or follows from the dataset.
        if iteration > 0 && !self.folder.as_ref().is_some_and(saved) {
            self.save_checkpoint()?;
        }
        Ok(stopped(&format!("after iteration {iteration} of the {stage} stage"), self.folder.as_ref()))
    }

    /// The fine stage starts with a new optimizer and new statistics.
    fn begin_fine_stage(&mut self) {
        self.state.stage = Stage::Fine;
        self.state.iteration = 0;
        self.state.adam = Adam::default();
        self.begin_motion();
        self.empty_images.reset();
        self.density.begin_stage(self.state.scene.gaussians.len(), &self.device.clone().inner());
    }

    fn restart_lap(&mut self) {
        self.lap = Some(Lap { begin: Instant::now(), iteration: self.state.iteration });
    }

    fn log(&mut self, report: &StepReport, is_last: bool) -> Result<(), TrainError> {
        let StepReport { stage, iteration, .. } = *report;
        if let Some(found) = not_finite_in(&self.state.scene, self.state.compression.as_ref()) {
            return Err(self.diverged(stage, iteration, found));
        }
        let rate = self.lap.map(|lap| (iteration - lap.iteration) as f64 / lap.begin.elapsed().as_secs_f64());
        self.restart_lap();
        let mut record = MetricsRecord::new(stage, iteration, report.seconds, report.gaussians);
        record.loss = Some(f64::from(report.loss));
        let training_psnr = psnr(report.image.clone(), report.truth.clone());
        record.psnr = Some(training_psnr);
        let background = Tensor::<1>::from_floats(self.data.background, &report.truth.device());
        let empty = background.reshape([1, 1, 3]).expand(report.truth.dims());
        let psnr_of_nothing = psnr(empty, report.truth.clone());
        let over = is_last && stage == Stage::Fine;
        if let Some(warning) = self.empty_images.log(training_psnr, psnr_of_nothing, is_last, over) {
            let advice = match unusual_key(&self.config) {
                Some(remedy) => format!("Try `--set {remedy}`"),
                None => "Lower the learning rates, or look whether the cameras see the points".to_owned(),
            };
            let warning = format!("{stage} stage, iteration {iteration}: {warning}. {advice}");
            self.observers.iter_mut().try_for_each(|observer| observer.on_warning(&warning))?;
        }
        record.iterations_per_second = rate;
        record.test_psnr = self.test_psnr(stage, iteration, is_last)?;
        self.observers.iter_mut().try_for_each(|observer| observer.on_log(&record))
    }

    fn save_checkpoint(&mut self) -> Result<(), TrainError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let path = folder.checkpoints().join(checkpoint_name(self.state.stage, self.state.iteration));
        self.state.density = self.density.state();
        self.state.corrections = self.corrections.state();
        self.state.save(&path).map_err(|error| match error {
            SaveError::NotFinite { tensor: name, index, value } => {
                let found = NotFinite::Parameter { name, index, value };
                self.diverged(self.state.stage, self.state.iteration, found)
            }
            SaveError::Other(error) => error,
        })?;
        let all = list_checkpoints(&folder.checkpoints());
        for old in &all[..all.len().saturating_sub(self.config.train.keep_checkpoints.max(1))] {
            // If an old checkpoint cannot be removed, it does no harm.
            let _ = std::fs::remove_file(old);
        }
        self.restart_lap();
        self.observers.iter_mut().try_for_each(|observer| observer.on_checkpoint(&path))
    }

    /// The error for numbers that are not finite.
    fn diverged(&self, stage: Stage, iteration: usize, found: NotFinite) -> TrainError {
        TrainError::Diverged(Box::new(Divergence {
            stage,
            iteration,
            checkpoint: self.folder.as_ref().and_then(RunFolder::last_checkpoint),
            run: self.folder.as_ref().map(|folder| folder.root().to_owned()),
            remedy: remedy(&found, &self.config),
            found,
        }))
    }

    fn splatter(&self, stage: Stage, iteration: usize) -> Splatter {
        let step = self.config.train.global_step(stage, iteration);
        let degree = (step / self.config.train.sh_degree_interval.max(1)).min(usize::from(self.config.model.sh_degree));
        Splatter::new(self.data.background, degree).with_backdrop(self.backdrop.clone())
    }

    /// PSNR of a few test views, rendered from the model in memory, if it is due.
    fn test_psnr(&self, stage: Stage, iteration: usize, is_last: bool) -> Result<Option<f64>, TrainError> {
        let eval = &self.config.eval;
        let frames = self.data.frames(Split::Test);
        let due = eval.interval > 0 && (iteration.is_multiple_of(eval.interval) || is_last);
        if !due || eval.views == 0 || frames.is_empty() {
            return Ok(None);
        }
        let stride = frames.len().div_ceil(eval.views);
        self.mean_psnr(frames.iter().step_by(stride), stage, iteration).map(Some)
    }

    /// Mean PSNR in dB over all views of a split, rendered from the model in memory: without coding, which takes away
    /// some quality. NaN for a split without views.
    ///
    /// # Errors
    /// [`TrainError::Data`] for an image that cannot be read.
    pub fn psnr(&self, split: Split) -> Result<f64, TrainError> {
        let (stage, iteration) = self.position();
        self.mean_psnr(self.data.frames(split).iter(), stage, iteration)
    }

    fn mean_psnr<'f>(
        &self,
        frames: impl Iterator<Item = &'f Frame>,
        stage: Stage,
        iteration: usize,
    ) -> Result<f64, TrainError> {
        let splatter = self.splatter(stage, iteration);
        let scene = Snapshot { scene: &self.state.scene, stage };
        let mut values = Vec::new();
        for frame in frames {
            let image = splatter.render(scene.gaussians_at(frame.time), &frame.camera, None).image.clamp(0.0, 1.0);
            values.push(psnr(image, image_tensor(&*self.images.image(frame)?, &self.device.clone().inner())));
        }
        Ok(values.iter().sum::<f64>() / values.len() as f64)
    }
}

/// The error of a run that was asked to stop.
fn stopped(place: &str, folder: Option<&RunFolder>) -> TrainError {
    let remedy = folder.map(|folder| format!("; `light4gs resume {}` goes on from there", folder.root().display()));
    TrainError::Stopped(format!("stopped on request {place}{}", remedy.unwrap_or_default()))
}

/// The model between two iterations.
struct Snapshot<'a, F: DeformationField> {
    scene: &'a DynamicScene<F>,
    stage: Stage,
}

impl<F: DeformationField> SceneInTraining for Snapshot<'_, F> {
    fn gaussians_at(&self, time: f32) -> GaussianTensors {
        let scene = self.scene.valid();
        match self.stage {
            Stage::Coarse => scene.gaussians.tensors(),
            Stage::Fine => scene.at(time),
        }
    }
}
