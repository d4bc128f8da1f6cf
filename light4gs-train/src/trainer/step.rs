//! One iteration: forward, backward, the optimizer's step.

use burn::tensor::Tensor;
use light4gs_data::Frame;
use light4gs_model::DeformationField;

use super::Trainer;
use super::learning_rates::GroupRates;
use crate::compression::EntropyModels;
use crate::density::{GaussianEditor, TrainingPosition, ViewStatistics};
use crate::divergence::{NotFinite, not_finite_in};
use crate::error::TrainError;
use crate::observers::StepReport;
use crate::optimization::gradients::GradientSums;
use crate::optimization::parameters::COMPRESSION;
use crate::regularizer::RegularizerInput;
use crate::sampling::BatchRequest;
use crate::stage::Stage;

/// Iterations ahead for which images are decoded.
const PREFETCHED_ITERATIONS: usize = 8;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Forward, backward, and one optimizer step.
    pub(super) fn optimize(&mut self, stage: Stage, iteration: usize) -> Result<StepReport, TrainError> {
        self.profile.begin_step();
        if stage == Stage::Fine {
            self.begin_motion_step(iteration);
            self.refine_motion(iteration)?;
        }
        let indices = self.batch(stage, iteration)?;
        let batch = indices.len();
        self.prefetch(stage, iteration)?;
        let noisy = self.quantization_noise(stage, iteration)?;
        self.profile.lap("quantization noise");
        let frames: Vec<&Frame> = indices.iter().map(|frame| &self.data.train[*frame]).collect();
        let pass = self.view_pass(stage, iteration, batch);
        let seen = noisy.as_ref().map_or(&self.state.scene, |noisy| &noisy.scene);
        let mut views = pass.run(seen, &frames, &self.view_pools, &self.profile)?;
        let mut gradients = GradientSums::default();
        for view in &mut views {
            gradients.add(std::mem::take(&mut view.gradients));
        }
        let rate = noisy.as_ref().and_then(|noisy| self.add_rate(noisy, iteration, &mut gradients));
        let regularizer = self.add_plane_regularizer(stage, iteration, &mut gradients);
        let own = self.add_field_regularizer(stage, iteration, &mut gradients);
        let others = self.add_regularizers(stage, iteration, &mut gradients);
        let regularizers = regularizer.into_iter().chain(own).chain(others);
        let terms = views.iter().map(|view| view.loss.clone()).chain(rate).chain(regularizers);
        let loss = terms.reduce(|sum, term| sum + term).expect("a batch has at least one view");
        // This number is all that an iteration reads back from the device.
        let loss: f32 = loss.into_scalar();
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
        self.state.adam.step_module("", &mut self.state.scene, &mut gradients, rate);
        if let Some(compression) = &mut self.state.compression {
            self.state.adam.step_module(COMPRESSION, compression, &mut gradients, rate);
            if noisy.is_some_and(|noisy| noisy.learns_steps()) {
                compression.bound_steps(&self.config);
            }
        }
        self.profile.lap("Adam");
        Ok(StepReport { stage, iteration, loss, image, truth, frame, gaussians: 0, seconds: 0.0 })
    }

    /// Starts to decode the images of later iterations in the background. Each call is for as many images as one
    /// iteration uses; those of earlier iterations are there already.
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

    /// What the sampler is asked for an iteration.
    pub(super) fn batch_request(&self, stage: Stage, iteration: usize) -> BatchRequest<'_> {
        let train = &self.config.train;
        BatchRequest {
            frames: &self.data.train,
            candidates: self.stage_frames.of(stage),
            batch_size: train.batch_size.max(1),
            stage,
            iteration,
            iterations: train.iterations(stage),
            seed: self.config.seed,
        }
    }

    /// Adds the gradients of the planes' regularizers, and returns their value, `[1]`.
    fn add_plane_regularizer(
        &mut self,
        stage: Stage,
        iteration: usize,
        gradients: &mut GradientSums,
    ) -> Option<Tensor<1>> {
        if stage == Stage::Coarse || self.planes_are_frozen(stage, iteration) {
            return None;
        }
        let scene = &self.state.scene;
        let term = self.config.train.regularizer.build().loss(scene.planes()?);
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
