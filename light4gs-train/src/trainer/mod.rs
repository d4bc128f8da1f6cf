//! The training loop: a coarse stage without motion, then a fine stage with the deformation field (paper IV-B).
//!
//! - here: stages, steps, checkpoints, what is logged
//! - `density`: how many Gaussians there are
//! - `rate`: what a small file asks of a step
//! - `views`: what the pictures ask of it

pub mod checkpoint;
mod density;
pub mod profile;
pub(crate) mod randomness;
mod rate;
pub mod run_folder;
mod stage;
mod views;

pub use stage::Stage;

use std::time::Instant;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use indicatif::{ProgressBar, ProgressStyle};
use light4gs_codec::SceneMeta;
use light4gs_data::{Frame, ImageStore, LoadOptions, Resolution, Scene, Split};
use light4gs_model::{Splatter, regularizer};

use crate::compression::{Compression, TrainedScene, write_scene};
use crate::config::{Config, TrainConfig};
use crate::density::densification::DensityStatistics;
use crate::device;
use crate::error::TrainError;
use crate::evaluation::metrics::{image_tensor, psnr};
use crate::observers::metrics_log::{MetricsLog, MetricsRecord};
use crate::observers::tensorboard::TensorBoard;
use crate::optimization::adam::Adam;
use crate::optimization::gradients::GradientSums;
use crate::optimization::learning_rates::GroupRates;
use crate::optimization::parameters::{ParameterGroup, ParameterVisitor, visit_compression, visit_parameters};
use crate::trainer::checkpoint::Checkpoint;
use crate::trainer::profile::Profile;
use crate::trainer::randomness::FrameOrder;
use crate::trainer::run_folder::{RunFolder, RunRecord};
use views::{ViewPass, ViewPools};

/// How a dataset is opened for a configuration.
pub fn load_options(config: &Config) -> LoadOptions {
    LoadOptions {
        resolution: config.data.resolution.map_or(Resolution::Native, Resolution::MaxSide),
        background: config.data.background,
        seed: config.seed,
        random_points: config.data.initial_points,
        random_half_size: config.data.initial_box,
        ..LoadOptions::default()
    }
}

/// A run in progress.
pub struct Trainer {
    config: Config,
    device: Device,
    data: Scene,
    images: ImageStore,
    folder: RunFolder,
    state: Checkpoint,
    metrics: MetricsLog,
    events: TensorBoard,
    order: FrameOrder,
    quiet: bool,
    profile: Profile,
    view_pools: ViewPools,
}

impl Trainer {
    /// Begins a run in a fresh folder.
    pub fn start(config: Config, folder: RunFolder, record: &RunRecord, quiet: bool) -> Result<Self, TrainError> {
        let device = device::open(config.device)?.autodiff();
        device.seed(config.seed);
        let data = Scene::open(&record.scene, &load_options(&config))?;
        let scene = config.model.build().init(&data.points, &device);
        let state = Checkpoint {
            statistics: DensityStatistics::new(scene.gaussians.len(), &device.clone().inner()),
            compression: Compression::of_run(&config, &device),
            scene,
            adam: Adam::default(),
            stage: Stage::Coarse,
            iteration: 0,
            seconds: 0.0,
        };
        Self::assemble(config, device, data, folder, state, quiet)
    }

    /// Continues a run from its newest checkpoint, or from the beginning if it has none.
    pub fn resume(config: Config, folder: RunFolder, record: &RunRecord, quiet: bool) -> Result<Self, TrainError> {
        let Some(path) = folder.last_checkpoint() else {
            let mut trainer = Self::start(config, folder, record, quiet)?;
            trainer.metrics.truncate_after(Stage::Coarse, 0)?;
            return Ok(trainer);
        };
        let device = device::open(config.device)?.autodiff();
        let data = Scene::open(&record.scene, &load_options(&config))?;
        let state = Checkpoint::load(&path, &config, &device)?;
        let (stage, iteration) = (state.stage, state.iteration);
        let mut trainer = Self::assemble(config, device, data, folder, state, quiet)?;
        trainer.metrics.truncate_after(stage, iteration)?;
        Ok(trainer)
    }

    fn assemble(
        config: Config,
        device: Device,
        data: Scene,
        folder: RunFolder,
        state: Checkpoint,
        quiet: bool,
    ) -> Result<Self, TrainError> {
        let images = ImageStore::new(&load_options(&config), (config.data.memory_limit_mib << 20) as usize);
        images.prefetch(&data.train);
        let metrics = MetricsLog::open(&folder.path("metrics.jsonl"))?;
        let step = global_step(&config.train, state.stage, state.iteration) as u64;
        let events = TensorBoard::create(&folder.path("events"), (step > 0).then_some(step + 1))?;
        let order = FrameOrder::default();
        let profile = Profile::off();
        // A graphics card is kept busy by one view at a time.
        let side_by_side = config.device.computes_on_processor();
        let view_pools = if side_by_side { ViewPools::new(config.train.batch_size) } else { ViewPools::none() };
        Ok(Self { config, device, data, images, folder, state, metrics, events, order, quiet, profile, view_pools })
    }

    /// From now on measures the stages of every step.
    pub fn measure_stages(&mut self) {
        self.profile = Profile::on(&self.device);
        // Stages can only be measured one after the other.
        self.view_pools = ViewPools::none();
    }

    /// What [`Trainer::measure_stages`] led to.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The dataset.
    pub fn data(&self) -> &Scene {
        &self.data
    }

    /// Seconds of training so far, over all sessions.
    pub fn seconds(&self) -> f64 {
        self.state.seconds
    }

    /// Trains to the end and writes `scene.l4gs`; returns its size in bytes.
    pub fn run(&mut self) -> Result<u64, TrainError> {
        if self.state.stage == Stage::Coarse {
            self.run_stage(Stage::Coarse, self.config.train.coarse_iterations)?;
            self.begin_fine_stage();
        }
        self.run_stage(Stage::Fine, self.config.train.fine_iterations)?;
        let trained = TrainedScene {
            scene: &self.state.scene,
            compression: self.state.compression.as_ref(),
            config: &self.config,
            data: &self.data,
            images: &self.images,
            device: &self.device,
        };
        let written = write_scene(&trained, &self.folder.stream(), self.quiet)?;
        if let Some((record, bit_maps)) = &written.coding {
            self.folder.write_json("coding.json", record)?;
            self.folder.write_json("bit_maps.json", bit_maps)?;
        }
        Ok(written.bytes)
    }

    /// The fine stage starts with a new optimiser and new statistics.
    fn begin_fine_stage(&mut self) {
        self.state.stage = Stage::Fine;
        self.state.iteration = 0;
        self.state.adam = Adam::default();
        self.reset_statistics();
    }

    fn reset_statistics(&mut self) {
        self.state.statistics = DensityStatistics::new(self.state.scene.gaussians.len(), &self.device.clone().inner());
    }

    fn run_stage(&mut self, stage: Stage, iterations: usize) -> Result<(), TrainError> {
        let bar = if self.quiet { ProgressBar::hidden() } else { ProgressBar::new(iterations as u64) };
        let style = "{prefix:>6} {wide_bar:.cyan/blue} {pos}/{len}  {per_sec}  ETA {eta}  {msg}";
        bar.set_style(ProgressStyle::with_template(style).expect("a valid template"));
        bar.set_prefix(stage.name());
        bar.set_position(self.state.iteration as u64);
        bar.reset_eta();
        let mut lap = (Instant::now(), self.state.iteration);
        while self.state.iteration < iterations {
            let iteration = self.state.iteration + 1;
            let begin = Instant::now();
            let picture = self.step(stage, iteration)?;
            self.control_density(stage, iteration);
            if stage == Stage::Fine && self.config.train.prune.is_due(iteration) {
                self.prune_insignificant(iteration);
            }
            self.profile.lap("density control");
            self.state.iteration = iteration;
            self.state.seconds += begin.elapsed().as_secs_f64();
            bar.inc(1);

            if iteration.is_multiple_of(self.config.train.log_interval) || iteration == iterations {
                let rate = (iteration - lap.1) as f64 / lap.0.elapsed().as_secs_f64();
                lap = (Instant::now(), iteration);
                let psnr = psnr(picture.image, picture.truth);
                let count = self.state.scene.gaussians.len();
                bar.set_message(format!("{psnr:.2} dB  {count} Gaussians"));
                let mut record = MetricsRecord::new(stage, iteration, self.state.seconds, count);
                record.loss = Some(f64::from(picture.loss));
                record.psnr = Some(psnr);
                record.iterations_per_second = Some(rate);
                record.test_psnr = self.test_psnr(stage, iteration, iterations)?;
                self.log(&record)?;
            }
            let interval = self.config.train.checkpoint_interval;
            if (interval > 0 && iteration.is_multiple_of(interval)) || iteration == iterations {
                self.save_checkpoint()?;
                lap = (Instant::now(), iteration);
            }
        }
        bar.finish();
        Ok(())
    }

    fn log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        self.metrics.append(record)?;
        let step = global_step(&self.config.train, record.stage, record.iteration) as u64;
        let mut scalars = vec![("gaussians", record.gaussians as f32)];
        let optional = [
            ("loss", record.loss),
            ("psnr/train", record.psnr),
            ("psnr/test", record.test_psnr),
            ("iterations_per_second", record.iterations_per_second),
        ];
        scalars.extend(optional.into_iter().filter_map(|(name, value)| Some((name, value? as f32))));
        Ok(self.events.scalars(step, &scalars)?)
    }

    fn save_checkpoint(&mut self) -> Result<(), TrainError> {
        let name = Checkpoint::file_name(self.state.stage, self.state.iteration);
        let folder = self.folder.checkpoints();
        self.state.save(&folder.join(name))?;
        let all = checkpoint::list(&folder);
        for old in &all[..all.len().saturating_sub(self.config.train.keep_checkpoints.max(1))] {
            // A checkpoint too many does no harm.
            let _ = std::fs::remove_file(old);
        }
        Ok(())
    }

    /// Forward, backward, and one optimiser step.
    fn step(&mut self, stage: Stage, iteration: usize) -> Result<StepPicture, TrainError> {
        self.profile.begin_step();
        let batch = self.config.train.batch_size.max(1);
        let count = self.data.train.len();
        let frames: Vec<usize> =
            (0..batch).map(|k| self.order.at(self.config.seed, stage, (iteration - 1) * batch + k, count)).collect();
        let noisy = self.quantization_noise(stage, iteration)?;
        self.profile.lap("quantisation noise");
        let frames: Vec<&Frame> = frames.into_iter().map(|frame| &self.data.train[frame]).collect();
        let config = &self.config.train;
        let pass = ViewPass {
            stage,
            splatter: self.splatter(stage, iteration),
            images: &self.images,
            device: &self.device,
            squared: config.l2_until > 0 && (stage == Stage::Coarse || iteration <= config.l2_until),
            lambda_dssim: config.lambda_dssim,
            weight: 1.0 / batch as f32,
        };
        let seen = noisy.as_ref().map_or(&self.state.scene, |noisy| &noisy.scene);
        let mut views = pass.run(seen, &frames, &self.view_pools, &self.profile)?;
        let mut gradients = GradientSums::default();
        for view in &mut views {
            gradients.add(std::mem::take(&mut view.gradients));
        }
        let rate = noisy.as_ref().and_then(|noisy| self.add_rate(noisy, iteration, &mut gradients));
        let regularizers = self.add_regularizers(stage, iteration, &mut gradients);
        let terms = views.iter().map(|view| view.loss.clone()).chain(rate).chain(regularizers);
        let loss = terms.reduce(|sum, term| sum + term).expect("a batch has at least one picture");
        // What a step reads back from the device: this number.
        let loss: f32 = loss.into_scalar();
        if !loss.is_finite() {
            let checkpoint = self.folder.last_checkpoint().map_or("none".into(), |path| path.display().to_string());
            return Err(TrainError::NotFinite { stage: stage.name(), iteration, loss, checkpoint });
        }
        let last = views.last().expect("a batch has at least one picture");
        let picture = StepPicture { loss, image: last.image.clone(), truth: last.truth.clone() };

        if iteration <= self.config.train.densify.until {
            for view in views {
                if let Some(gradient) = view.screen_gradient {
                    // The loss is a mean over the batch; thresholds are meant for one picture.
                    self.state.statistics.add(gradient * batch as f32, view.radii);
                }
            }
        }
        self.profile.lap("density statistics");
        let rates = GroupRates::new(&self.config, stage, iteration, self.data.extent);
        let mut step = AdamVisitor { adam: &mut self.state.adam, gradients: &mut gradients, rates };
        visit_parameters(&mut self.state.scene, &mut step);
        if let Some(compression) = &mut self.state.compression {
            visit_compression(compression, &mut step);
            if noisy.is_some_and(|noisy| noisy.learns_steps()) {
                compression.bound_steps(&self.config);
            }
        }
        self.profile.lap("Adam");
        Ok(picture)
    }

    /// Adds the gradients of the regularisers, and returns their value, `[1]`.
    fn add_regularizers(&mut self, stage: Stage, iteration: usize, gradients: &mut GradientSums) -> Option<Tensor<1>> {
        if stage == Stage::Coarse || self.planes_are_settled(stage, iteration) {
            return None;
        }
        let scene = &mut self.state.scene;
        let weights = &self.config.train.regularizer;
        let term = regularizer::weighted_sum(
            &scene.field.hexplane,
            weights.plane_tv,
            weights.time_smoothness,
            weights.time_l1,
        );
        let value = term.clone().inner();
        gradients.add_scene(scene, &mut term.backward());
        self.profile.lap("regularisers");
        Some(value)
    }

    fn splatter(&self, stage: Stage, iteration: usize) -> Splatter {
        let step = global_step(&self.config.train, stage, iteration);
        let degree = (step / self.config.train.sh_degree_interval.max(1)).min(usize::from(self.config.model.sh_degree));
        Splatter::new(self.config.data.background, degree)
    }

    /// PSNR of a few test views by the model in memory, when it is due.
    fn test_psnr(&self, stage: Stage, iteration: usize, last: usize) -> Result<Option<f64>, TrainError> {
        let eval = &self.config.eval;
        let frames = self.data.frames(Split::Test);
        let due = eval.interval > 0 && (iteration.is_multiple_of(eval.interval) || iteration == last);
        if !due || eval.views == 0 || frames.is_empty() {
            return Ok(None);
        }
        let splatter = self.splatter(stage, iteration);
        let stride = frames.len().div_ceil(eval.views);
        let scene = self.state.scene.valid();
        let mut values = Vec::new();
        for frame in frames.iter().step_by(stride) {
            let gaussians = match stage {
                Stage::Coarse => scene.gaussians.tensors(),
                Stage::Fine => scene.at(frame.time),
            };
            let image = splatter.render(gaussians, &frame.camera, None).image.clamp(0.0, 1.0);
            values.push(psnr(image, image_tensor(&*self.images.get(frame)?, &self.device.clone().inner())));
        }
        Ok(Some(values.iter().sum::<f64>() / values.len() as f64))
    }
}

/// Iterations done over both stages.
fn global_step(config: &TrainConfig, stage: Stage, iteration: usize) -> usize {
    match stage {
        Stage::Coarse => iteration,
        Stage::Fine => config.coarse_iterations + iteration,
    }
}

/// The last picture of a batch, off the tape.
struct StepPicture {
    loss: f32,
    image: Tensor<3>,
    truth: Tensor<3>,
}

struct AdamVisitor<'a> {
    adam: &'a mut Adam,
    gradients: &'a mut GradientSums,
    rates: GroupRates,
}

impl ParameterVisitor for AdamVisitor<'_> {
    fn visit<const D: usize>(&mut self, group: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove(name) {
            let gradient = gradient.reshape(parameter.val().dims());
            self.adam.step(name, parameter, gradient, self.rates.of(group));
        }
    }
}

/// What the file says about the scene it was made from.
pub fn scene_meta(config: &Config, data: &Scene) -> SceneMeta {
    let positions = &data.points.positions;
    let bound = |pick: fn(f32, f32) -> f32, start: f32| {
        std::array::from_fn(|axis| positions.iter().map(|p| p[axis]).fold(start, pick))
    };
    let bounds =
        if positions.is_empty() { [[0.0; 3]; 2] } else { [bound(f32::min, f32::MAX), bound(f32::max, f32::MIN)] };
    let camera = data.train[0].camera;
    let mut times: Vec<f32> = data.train.iter().map(|frame| frame.time).collect();
    times.sort_by(f32::total_cmp);
    times.dedup();
    SceneMeta {
        name: data.name.clone(),
        frame_count: times.len() as u32,
        // Times are a share of the whole; nobody says how long it lasts.
        fps: 0.0,
        bounds,
        background: data.background,
        config_digest: config.digest(),
        width: camera.width,
        height: camera.height,
        fov_x: camera.fov().0,
        ..SceneMeta::default()
    }
}
