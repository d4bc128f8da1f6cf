//! One iteration: forward, backward, the optimizer's step.

use burn::tensor::{Tensor, Transaction};
use light4gs_data::Frame;
use light4gs_model::{DeformationField, GpuError};

use super::Trainer;
use super::learning_rates::GroupRates;
use super::views::{View, ViewPass};
use crate::compression::{EntropyModels, NoisyScene};
use crate::corrections::ViewCorrection;
use crate::density::{GaussianEditor, TrainingPosition, ViewStatistics};
use crate::divergence::{NotFinite, not_finite_in};
use crate::error::TrainError;
use crate::observers::StepReport;
use crate::optimization::adam::SteppedModule;
use crate::optimization::gradients::GradientSums;
use crate::optimization::parameters::COMPRESSION;
use crate::regularizer::RegularizerInput;
use crate::run::Checkpoint;
use crate::sampling::BatchRequest;
use crate::stage::Stage;

/// The results of a step before anything changes.
struct Differentiated {
    views: Vec<View>,
    /// Of the loss with respect to all parameters.
    gradients: GradientSums,
    /// Numbers whose sum is the loss.
    loss: Vec<Tensor<1>>,
}

impl Differentiated {
    /// Reads the loss, and what the host needs of each view, in one transfer: the host waits for each. A plain iteration reads
    /// nothing else from the device.
    ///
    /// # Errors
    /// An operation of the step that failed on the GPU.
    fn read(&self) -> Result<Read, GpuError> {
        let read = self.loss.iter().fold(Transaction::default(), |read, term| read.register(term.clone()));
        let read = self.views.iter().fold(read, |read, view| read.register(view.intersections.clone()));
        let corrections = self.views.iter().flat_map(|view| view.corrections.clone());
        let read = corrections.fold(read, |read, gradient| read.register(gradient));
        let read = GpuError::read("a training step", read)?;
        let (loss, views) = read.split_at(self.loss.len());
        let (intersections, corrections) = views.split_at(self.views.len());
        let intersections = intersections.iter().flat_map(|data| data.iter::<i64>()).map(|count| count as usize);
        Ok(Read {
            loss: loss.iter().flat_map(|term| term.iter::<f32>()).sum(),
            intersections: intersections.collect(),
            corrections: corrections.iter().map(|data| data.iter::<f32>().collect()).collect(),
        })
    }
}

/// What the host reads of a step.
#[derive(Debug, PartialEq)]
struct Read {
    loss: f32,
    /// By view.
    intersections: Vec<usize>,
    /// The gradient of each view's corrections; empty where nothing is learned.
    corrections: Vec<Vec<f32>>,
}

/// Iterations ahead for which images are decoded.
const PREFETCHED_ITERATIONS: usize = 8;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Forward, backward, and one optimizer step.
    pub(super) fn optimize(&mut self, stage: Stage, iteration: usize) -> Result<StepReport, TrainError> {
        self.profile.begin_step();
        if stage == Stage::Fine {
            self.begin_motion_step(iteration);
        }
        let indices = self.batch(stage, iteration)?;
        let batch = indices.len();
        self.prefetch(stage, iteration)?;
        let noisy = self.quantization_noise(stage, iteration)?;
        self.profile.lap("quantization noise");
        let (Differentiated { views, mut gradients, .. }, Read { loss, corrections, .. }) = loop {
            let step = self.differentiate(stage, iteration, &indices, noisy.as_ref())?;
            let read = step.read()?;
            if self.list_room.learn(&read.intersections) {
                break (step, read);
            }
        };
        if !loss.is_finite() {
            let parameter = not_finite_in(&self.state.scene, self.state.compression.as_ref());
            return Err(self.diverged(stage, iteration, parameter.unwrap_or(NotFinite::Loss(loss))));
        }
        let last = views.last().expect("a batch has at least one view");
        let (image, truth) = (last.image.clone(), last.truth.clone());
        let frame = indices[batch - 1];

        let statistics: Vec<ViewStatistics> = views.into_iter().map(|view| view.statistics).collect();
        self.density.after_backward(&statistics, &self.training_position(stage, iteration));
        self.profile.lap("density statistics");
        let attributes = self.state.scene.gaussians.attributes();
        let rates = GroupRates::new(&self.config, attributes, stage, iteration, self.data.extent);
        let field_rates = self.field_rates(&rates);
        let rate = |group, path: &str| field_rates.get(path).copied().or_else(|| rates.of(group, path));
        let Checkpoint { scene, compression, adam, .. } = &mut self.state;
        let mut modules: Vec<(&str, &mut dyn SteppedModule)> = vec![("", scene)];
        modules.extend(compression.as_mut().map(|compression| (COMPRESSION, compression as _)));
        adam.step_modules(&mut modules, &mut gradients, rate);
        if let Some(compression) = compression
            && noisy.is_some_and(|noisy| noisy.learned_steps().is_some())
        {
            compression.bound_steps(&self.config);
        }
        self.learn_corrections(stage, iteration, &indices, &corrections);
        self.profile.lap("Adam");
        Ok(StepReport { stage, iteration, loss, image, truth, frame, gaussians: 0, seconds: 0.0 })
    }

    /// The loss of a step with its gradients. A second call gives the same result.
    fn differentiate(
        &self,
        stage: Stage,
        iteration: usize,
        indices: &[usize],
        noisy: Option<&NoisyScene<F>>,
    ) -> Result<Differentiated, TrainError> {
        let frames: Vec<_> =
            indices.iter().map(|frame| (&self.data.train[*frame], self.correction(stage, iteration, *frame))).collect();
        let pass = self.view_pass(stage, iteration, indices.len());
        let pass = ViewPass { splatter: self.list_room.reserve(pass.splatter), ..pass };
        let seen = noisy.map_or(&self.state.scene, |noisy| &noisy.scene);
        // On a processor the rate is differentiated beside the views, since it hardly occupies more than one thread. On a GPU
        // only the positions are read beside them, for which the host would wait.
        let places = noisy.and_then(|noisy| self.begin_places(noisy, iteration));
        let rate = || noisy.and_then(|noisy| self.rate(noisy, places, iteration));
        let (mut views, rate) = pass.run(seen, &frames, &self.view_pools, &self.profile, rate)?;
        let mut gradients = GradientSums::default();
        for view in &mut views {
            gradients.add(std::mem::take(&mut view.gradients));
        }
        let rate = noisy.and_then(|noisy| self.add_rate(noisy, iteration, rate, &mut gradients));
        let regularizer = self.add_plane_regularizer(stage, iteration, &mut gradients);
        let own = self.add_field_regularizer(stage, iteration, &mut gradients);
        let others = self.add_regularizers(stage, iteration, &mut gradients);
        let regularizers = regularizer.into_iter().chain(own).chain(others);
        let loss = views.iter().map(|view| view.loss.clone()).chain(rate).chain(regularizers).collect();
        Ok(Differentiated { views, gradients, loss })
    }

    /// The corrections of a training frame in an iteration of a stage, where there are any.
    pub(super) fn correction(&self, stage: Stage, iteration: usize, frame: usize) -> Option<ViewCorrection> {
        self.corrections.of_frame(frame, stage, self.config.train.global_step(stage, iteration))
    }

    /// One step of the corrections, with the gradients of the views `indices`.
    fn learn_corrections(&mut self, stage: Stage, iteration: usize, indices: &[usize], gradients: &[Vec<f32>]) {
        // The loss is a mean over the batch; corrections are weighed against the loss of their view alone.
        let batch = indices.len() as f32;
        let views: Vec<_> = (indices.iter().zip(gradients))
            .filter_map(|(frame, numbers)| {
                Some((*frame, self.correction(stage, iteration, *frame)?.gradient(numbers, batch)))
            })
            .collect();
        if !views.is_empty() {
            let step = self.config.train.global_step(stage, iteration);
            self.corrections.learn(views.iter().map(|(frame, gradient)| (*frame, gradient)), step);
        }
    }

    /// Starts to decode the images of one later iteration in the background. Those of earlier iterations are there already.
    fn prefetch(&mut self, stage: Stage, iteration: usize) -> Result<(), TrainError> {
        let indices = self.batch(stage, iteration + PREFETCHED_ITERATIONS)?;
        let frames: Vec<Frame> = indices.into_iter().map(|frame| self.data.train[frame].clone()).collect();
        self.images.prefetch(&frames);
        Ok(())
    }

    /// The frames of an iteration, by their indices in the training split.
    fn batch(&self, stage: Stage, iteration: usize) -> Result<Vec<usize>, TrainError> {
        self.sampled(&self.batch_request(stage, iteration))
    }

    /// The frames that the sampler gives for a request, by their indices in the training split.
    pub(super) fn sampled(&self, request: &BatchRequest) -> Result<Vec<usize>, TrainError> {
        let frames = &self.data.train;
        let (stage, iteration) = (request.stage, request.iteration);
        let indices = self.sampler.batch(request);
        let problem = match indices.iter().find(|index| **index >= frames.len()) {
            Some(index) => format!("frame {index} of {}", frames.len()),
            None if indices.is_empty() => "no frame".to_owned(),
            None => return Ok(indices),
        };
        let place = format!("iteration {iteration} of the {stage} stage");
        Err(TrainError::Input(format!(
            "the sampler gives {problem} for {place}; it must name at least one training frame"
        )))
    }

    /// The request to the sampler for an iteration.
    pub(super) fn batch_request(&self, stage: Stage, iteration: usize) -> BatchRequest<'_> {
        let train = &self.config.train;
        BatchRequest {
            frames: &self.data.train,
            candidates: &self.candidates,
            batch_size: train.batch_size.max(1),
            stage,
            iteration,
            iterations: train.iterations(stage),
            seed: self.config.seed,
        }
    }

    /// Adds the gradients of the planes' regularizers, and returns their value, `[1]`.
    fn add_plane_regularizer(&self, stage: Stage, iteration: usize, gradients: &mut GradientSums) -> Option<Tensor<1>> {
        if stage == Stage::Coarse || self.planes_are_frozen(stage, iteration) {
            return None;
        }
        let scene = &self.state.scene;
        let term = self.config.train.regularizer.loss(scene.planes()?);
        let value = term.clone().inner();
        gradients.add_module(scene, &mut term.backward());
        self.profile.lap("regularizers");
        Some(value)
    }

    /// Adds the gradients of further regularizers, and returns the values of those that apply, `[1]` each.
    fn add_regularizers(&self, stage: Stage, iteration: usize, gradients: &mut GradientSums) -> Vec<Tensor<1>> {
        let scene = &self.state.scene;
        let input = RegularizerInput { scene, stage, iteration, iterations: self.config.train.iterations(stage) };
        let terms = self.regularizers.iter().filter_map(|regularizer| regularizer.loss(input));
        let add = |term: Tensor<1>| {
            let value = term.clone().inner();
            gradients.add_module(scene, &mut term.backward());
            self.profile.lap("regularizers");
            value
        };
        terms.map(add).collect()
    }

    fn training_position(&self, stage: Stage, iteration: usize) -> TrainingPosition {
        let train = &self.config.train;
        let progress = train.progress(stage, iteration);
        // Cameras may differ in size: the largest images count.
        let factors = self.data.train.iter().map(|frame| train.coarse_to_fine.factor(progress, &frame.camera));
        let image_factor = factors.max().unwrap_or(1);
        TrainingPosition { stage, iteration, image_factor, extent: self.data.extent, seed: self.config.seed }
    }

    /// Cloning, splitting and pruning, where they are due.
    pub(super) fn control_density(&mut self, stage: Stage, iteration: usize) {
        let position = self.training_position(stage, iteration);
        let mut editor = GaussianEditor::new(&mut self.state.scene.gaussians, &mut self.state.adam);
        self.density.after_step(&mut editor, &position);
        if stage == Stage::Fine && self.config.train.prune.is_due(iteration) {
            self.prune_insignificant(iteration);
        }
        self.profile.lap("density control");
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use light4gs_data::{Camera, PointCloud, RgbImage8, Scene, SplitFrames};

    use super::super::list_room::ListRoom;
    use super::*;
    use crate::config::{Config, DeviceName};
    use crate::dataset::MemoryImages;

    /// Two views of a gray image, a few Gaussians, and the rate in every step.
    fn trainer(preset: &str, device: DeviceName) -> Trainer {
        let keys = [
            "train.batch_size=2",
            "train.coarse_iterations=2",
            "train.fine_iterations=6",
            "train.densify.strategy=none",
            "train.prune.fraction=0",
            "compression.rate.lambda=0.1",
            "compression.rate.from=1",
            "compression.rate.interval=1",
            "eval.interval=0",
        ];
        let mut config = Config::load(preset, &keys.map(str::to_owned)).unwrap();
        config.device = device;
        let camera = Camera::look_at([4.0, 0.0, 0.5].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 40);
        let frames: Vec<Frame> =
            [0.2, 0.8].map(|time| Frame::without_image(format!("view-{time}"), camera, time)).into();
        let image = RgbImage8 { width: 40, height: 40, pixels: vec![100; 40 * 40 * 3] };
        let images: MemoryImages = frames.iter().map(|frame| (frame.name.clone(), image.clone())).collect();
        let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
        let data = Scene::new("memory", Path::new("gray"), frames, PointCloud::random(60, 0.8, 0), [1.0; 3]).unwrap();
        Trainer::builder(config, data).images(images).build().unwrap()
    }

    /// Also with planes, whose latents have noise from the device's generator.
    #[test]
    fn what_is_computed_again_is_the_same() {
        let mut trainer = trainer("hexplane-dnerf-cpu", DeviceName::Flex);
        (0..4).for_each(|_| drop(trainer.step().unwrap()));
        let noisy = trainer.quantization_noise(Stage::Fine, 3).unwrap().unwrap();
        let [first, second] = [(), ()].map(|()| trainer.differentiate(Stage::Fine, 3, &[0, 1], Some(&noisy)).unwrap());
        assert_eq!(first.read(), second.read());
        let id = noisy.scene.planes().unwrap().planes[0].id;
        let gradient = |step: Differentiated| { step }.gradients.get(&[id]).remove(0).unwrap().into_data();
        assert_eq!(gradient(first), gradient(second));
    }

    #[cfg(feature = "wgpu")]
    #[test]
    fn a_step_whose_lists_had_no_room_is_computed_again() {
        let losses = |squeezed: bool| {
            let mut trainer = trainer("dnerf", DeviceName::Wgpu(crate::config::Adapter::Strongest));
            let mut losses = Vec::new();
            loop {
                if squeezed {
                    trainer.list_room = ListRoom::with(7);
                }
                let Some(step) = trainer.step().unwrap() else { break losses };
                losses.push(step.loss);
            }
        };
        let expected = losses(false);
        assert_eq!(expected.len(), 8);
        assert_eq!(losses(true), expected);
    }
}
