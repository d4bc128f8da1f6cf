//! The parts of a trainer.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::checks;
use light4gs_data::{PointCloud, Scene};
use light4gs_model::attributes::{BUILT_IN, check_further};
use light4gs_model::{Attribute, Backdrop, BuiltInField, DeformationField, DynamicSceneConfig, ModelError};

use super::Trainer;
use super::background::Background;
use super::list_room::ListRoom;
use super::profile::Profile;
use super::views::{NoOffsets, ViewPools};
use crate::compression::{Compression, ConfiguredModels, EntropyModels, compression_input};
use crate::config::Config;
use crate::corrections::{Corrections, Schedule};
use crate::dataset::{ImageSource, image_store, scene_meta};
use crate::density::{DensityStrategy, SignificanceScore, VolumeWeightedScore};
use crate::device;
use crate::divergence::EmptyImageWatch;
use crate::error::TrainError;
use crate::loss::Loss;
use crate::observers::Observer;
use crate::observers::metrics_log::MetricsLog;
use crate::optimization::adam::Adam;
use crate::regularizer::Regularizer;
use crate::run::{Checkpoint, RunFolder};
use crate::sampling::{CandidateFrames, FrameSampler};
use crate::stage::Stage;
use crate::take::{Base, HIDDEN, Start, backdrop_of};

/// The parts of a [`Trainer`]. Parts that are not given are made as the configuration says.
pub struct TrainerBuilder<F: DeformationField = BuiltInField, E: EntropyModels = ConfiguredModels> {
    config: Config,
    data: Scene,
    field: F::Config,
    attributes: Vec<Attribute>,
    models: E,
    device: Option<Device>,
    images: Option<Box<dyn ImageSource>>,
    folder: Option<RunFolder>,
    loss: Box<dyn Loss>,
    sampler: Box<dyn FrameSampler>,
    regularizers: Vec<Box<dyn Regularizer<F>>>,
    density: Box<dyn DensityStrategy>,
    significance: Box<dyn SignificanceScore>,
    observers: Vec<Box<dyn Observer>>,
    accept_changed_dataset: bool,
    stop: Arc<AtomicBool>,
}

impl<F: DeformationField> TrainerBuilder<F> {
    pub(super) fn new(config: Config, data: Scene, field: F::Config) -> Self {
        Self {
            device: None,
            images: None,
            folder: None,
            loss: config.train.losses.of(config.train.loss),
            sampler: config.train.samplers.of(config.train.sampling),
            regularizers: Vec::new(),
            density: config.train.densify.chosen().strategy(),
            significance: Box::new(VolumeWeightedScore::new(&config.train.prune)),
            observers: Vec::new(),
            accept_changed_dataset: false,
            stop: Arc::default(),
            config,
            data,
            field,
            attributes: Vec::new(),
            models: ConfiguredModels,
        }
    }
}

impl<F: DeformationField, E: EntropyModels> TrainerBuilder<F, E> {
    /// Entropy models of your own, instead of those that the configuration describes.
    pub fn entropy_models<O: EntropyModels>(self, models: O) -> TrainerBuilder<F, O> {
        let Self {
            config,
            data,
            field,
            attributes,
            models: _,
            device,
            images,
            folder,
            loss,
            sampler,
            regularizers,
            density,
            significance,
            observers,
            accept_changed_dataset,
            stop,
        } = self;
        TrainerBuilder {
            config,
            data,
            field,
            attributes,
            models,
            device,
            images,
            folder,
            loss,
            sampler,
            regularizers,
            density,
            significance,
            observers,
            accept_changed_dataset,
            stop,
        }
    }

    /// Trains on this device instead of the one that the configuration names.
    pub fn device(mut self, device: Device) -> Self {
        self.device = Some(device);
        self
    }

    /// The source of images; without it, they are read from the files of the frames.
    pub fn images(mut self, images: impl ImageSource + 'static) -> Self {
        self.images = Some(Box::new(images));
        self
    }

    /// Writes metrics, checkpoints and the finished file into a folder.
    pub fn run_folder(mut self, folder: RunFolder) -> Self {
        self.folder = Some(folder);
        self
    }

    /// The loss that compares rendered views with training images, instead of the configured one.
    pub fn loss(mut self, loss: impl Loss + 'static) -> Self {
        self.loss = Box::new(loss);
        self
    }

    /// The frame sampler, instead of the configured one.
    pub fn sampler(mut self, sampler: impl FrameSampler + 'static) -> Self {
        self.sampler = Box::new(sampler);
        self
    }

    /// One more term of the loss, over the scene instead of a view. It is added to the regularizers of the planes.
    pub fn regularizer(mut self, regularizer: impl Regularizer<F> + 'static) -> Self {
        self.regularizers.push(Box::new(regularizer));
        self
    }

    /// The density strategy, instead of the configured one.
    pub fn density(mut self, strategy: impl DensityStrategy + 'static) -> Self {
        self.density = Box::new(strategy);
        self
    }

    /// The score by which Gaussians are pruned after densification, instead of
    /// [`VolumeWeightedScore`](crate::density::VolumeWeightedScore).
    pub fn significance(mut self, score: impl SignificanceScore + 'static) -> Self {
        self.significance = Box::new(score);
        self
    }

    /// One more observer. Observers are called in the order in which they were added, after the logs of the run folder.
    pub fn observer(mut self, observer: impl Observer + 'static) -> Self {
        self.observers.push(Box::new(observer));
        self
    }

    /// Continues a run even if its dataset has changed since the run began.
    pub fn accept_changed_dataset(mut self) -> Self {
        self.accept_changed_dataset = true;
        self
    }

    /// A request to stop, which may be set at any time from anywhere: before its next iteration the trainer then writes
    /// a checkpoint and returns [`TrainError::Stopped`]. [`TrainerBuilder::resume`] continues from there to the same
    /// result.
    pub fn stop_flag(mut self, stop: Arc<AtomicBool>) -> Self {
        self.stop = stop;
        self
    }

    /// One more attribute of every Gaussian, besides those that the deformation field needs: trained at its rate,
    /// copied where Gaussians are cloned and split, kept in checkpoints, stored with its step.
    pub fn attribute(mut self, attribute: Attribute) -> Self {
        self.attributes.push(attribute);
        self
    }

    /// Begins a run.
    ///
    /// # Errors
    /// - [`TrainError::Config`] for a configuration out of range
    /// - [`TrainError::Input`] for a device that does not exist, a dataset without training frames, or one that has changed
    /// - [`TrainError::Codec`], [`TrainError::Model`] for a scene that the encoder would refuse at the end
    /// - [`TrainError::Data`] for logs that cannot be opened
    /// - [`TrainError::RunInUse`] for a folder into which another process writes
    pub fn build(mut self) -> Result<Trainer<F, E>, TrainError> {
        let device = self.open_device()?;
        self.begin(device)
    }

    /// Continues the run of the folder from its newest checkpoint, or begins it if there is none. The result is the
    /// same as if it had never been interrupted: bit-identical on a CPU.
    ///
    /// # Errors
    /// As [`TrainerBuilder::build`]; [`TrainError::Checkpoint`] if the checkpoint does not fit the configuration;
    /// [`TrainError::Input`] with the changes if the dataset has changed since the run began.
    pub fn resume(mut self) -> Result<Trainer<F, E>, TrainError> {
        let device = self.open_device()?;
        match self.folder.as_ref().and_then(RunFolder::last_checkpoint) {
            None => self.begin(device),
            Some(path) => {
                let state = Checkpoint::load(&path, &self.config, &self.scene(), &self.models, &device)?;
                let folder = self.folder.as_ref().expect("a checkpoint is in a folder");
                let backdrop = backdrop_of(&self.config, folder, &device)?;
                self.assemble(device, state, backdrop, Some(path))
            }
        }
    }

    fn open_device(&mut self) -> Result<Device, TrainError> {
        self.config.validate()?;
        if let Some(folder) = &mut self.folder {
            folder.lock()?;
            // Images from another source have no files to compare.
            if self.images.is_none() {
                folder.check_dataset(&self.data, self.accept_changed_dataset)?;
            }
        }
        if self.data.train.is_empty() {
            return Err(TrainError::Input(format!("the dataset `{}` has no training frames", self.data.name)));
        }
        let scene = self.scene();
        check_further(&scene.gaussians.further)
            .map_err(|problem| TrainError::Input(format!("attribute of the Gaussians: {problem}")))?;
        self.config.check_attributes(BUILT_IN.iter().chain(&scene.gaussians.further))?;
        // Refused now, since the encoder would refuse it at the end.
        light4gs_codec::checks::positions(&self.data.points.positions).map_err(|error| {
            TrainError::Input(format!("the point cloud of the dataset {}: {error}", self.data.root.display()))
        })?;
        let device = match &self.device {
            Some(device) => device.clone(),
            None => device::open(self.config.device)?,
        };
        Ok(device.autodiff())
    }

    /// Whether a run can begin: does the checks of [`TrainerBuilder::build`] before a folder is made or emptied for it.
    ///
    /// # Errors
    /// As [`TrainerBuilder::build`], except for those about the folder.
    pub fn check(mut self) -> Result<(), TrainError> {
        self.folder = None;
        let device = self.open_device()?;
        self.first_state(&self.data.points, &device).map(|_| ())
    }

    fn begin(mut self, device: Device) -> Result<Trainer<F, E>, TrainError> {
        let Some(base) = Base::of(&self.config, self.folder.as_ref())? else {
            let state = self.first_state(&self.data.points, &device)?;
            return self.assemble(device, state, None, None);
        };
        let images = self.images.take().unwrap_or_else(|| Box::new(image_store(&self.config)));
        let count = self.config.data.initial_points;
        let plain = device.clone().inner();
        let Start { hidden, points } = Start::of(&base, &self.data, &*images, count, self.config.seed, &plain)?;
        self.images = Some(images);
        if let Some(folder) = &self.folder {
            folder.write_json(HIDDEN, &hidden)?;
        }
        let state = self.first_state(&points, &device)?;
        self.assemble(device, state, Some(Backdrop::new(&base.without(&hidden)?, &plain)), None)
    }

    /// The configuration of the scene.
    fn scene(&self) -> DynamicSceneConfig<F> {
        let mut scene = self.config.model.scene::<F>(self.field.clone());
        scene.gaussians.further.extend(self.attributes.iter().cloned());
        scene
    }

    /// The state at the beginning of training, with Gaussians at these points.
    fn first_state(&self, points: &PointCloud, device: &Device) -> Result<Checkpoint<F, E>, TrainError> {
        device.seed(self.config.seed);
        let scene = self.scene().init(points, device);
        let state = Checkpoint {
            compression: Compression::of_run(&self.models, &self.config, &scene, device)?,
            scene,
            adam: Adam::default(),
            density: Default::default(),
            corrections: Default::default(),
            stage: Stage::Coarse,
            iteration: 0,
            seconds: 0.0,
            rate_weight: 1.0,
        };
        self.check_encodable(&state)?;
        Ok(state)
    }

    /// Refuses what the encoder would refuse at the end, by checking the initial scene and models.
    fn check_encodable(&self, state: &Checkpoint<F, E>) -> Result<(), TrainError> {
        let scene = state.scene.valid();
        let meta = scene_meta(&self.config, &self.data);
        // A field whose coding is not implemented can be trained all the same.
        let arrays = match scene.to_arrays(meta.clone()) {
            Err(ModelError::NoStreamForm { .. }) => scene.to_arrays_at_rest(meta),
            arrays => {
                let arrays = arrays?;
                arrays.check_attributes_are_known().map_err(|error| {
                    let remedy = "let the deformation field's network read it, or mark it with `Attribute::optional`";
                    TrainError::Input(format!("{error}. As its author: {remedy}"))
                })?;
                arrays
            }
        };
        let settings = &self.config.compression;
        match (&state.compression, settings.profile.coded()) {
            (Some(compression), Some(profile)) => {
                let input = compression_input(&mut compression.valid(), &scene, &arrays, settings, profile)?;
                checks::coding(&arrays, &input)?;
            }
            _ => checks::scene(&arrays)?,
        }
        Ok(())
    }

    /// `checkpoint` is the file from which `state` was read.
    fn assemble(
        self,
        device: Device,
        mut state: Checkpoint<F, E>,
        backdrop: Option<Backdrop>,
        checkpoint: Option<PathBuf>,
    ) -> Result<Trainer<F, E>, TrainError> {
        let Self { config, data, models, images, folder, observers, stop, .. } = self;
        let Self { loss, sampler, regularizers, mut density, significance, .. } = self;
        let count = state.scene.gaussians.len();
        let train = &config.train;
        let iterations = train.coarse_iterations + train.fine_iterations;
        let schedule = Schedule { iterations, views: train.batch_size.max(1) };
        let mut corrections = Corrections::new(&train.corrections, &data, schedule);
        match checkpoint {
            None => density.begin_stage(count, &device.clone().inner()),
            Some(path) => density
                .restore(std::mem::take(&mut state.density), count)
                .and_then(|()| corrections.restore(std::mem::take(&mut state.corrections)))
                .map_err(|problem| TrainError::Checkpoint { path, problem })?,
        }
        let images = images.unwrap_or_else(|| Box::new(image_store(&config)));
        images.prefetch(&data.train);
        let mut all: Vec<Box<dyn Observer>> = Vec::new();
        if let Some(folder) = &folder {
            let mut metrics = MetricsLog::open(&folder.path("metrics.jsonl"))?;
            metrics.truncate_after(state.stage, state.iteration)?;
            all.push(Box::new(metrics));
        }
        all.extend(observers);
        // A graphics card is busy with a single view.
        let side_by_side = device::computes_on_processor(&device);
        let view_pools = if side_by_side { ViewPools::new(config.train.batch_size) } else { ViewPools::none() };
        let candidates = CandidateFrames::new(&data.train);
        Ok(Trainer {
            config,
            device,
            data,
            images,
            folder,
            state,
            models,
            loss,
            corrections,
            backdrop,
            density,
            significance,
            observers: all,
            stop,
            sampler,
            candidates,
            regularizers,
            profile: Profile::off(),
            view_pools,
            list_room: ListRoom::new(!side_by_side),
            offsets: NoOffsets::default(),
            background: Background::new(!side_by_side),
            lap: None,
            empty_images: EmptyImageWatch::default(),
        })
    }
}
