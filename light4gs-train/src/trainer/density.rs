//! When Gaussians come and go: cloning, splitting, pruning by opacity, and pruning by significance (paper III-B, IV-B).

use std::collections::BTreeMap;

use burn::module::Module;
use light4gs_data::Frame;
use light4gs_model::{Significance, least_significant};
use rand::Rng;

use super::Trainer;
use crate::density::densification::{
    DensifyMasks, SizeLimit, densify, largest_scales, prune, reset_opacity, survivors,
};
use crate::trainer::Stage;
use crate::trainer::randomness::{Purpose, generator, standard_normal};

/// Gaussians larger than this on the screen, in pixels, are dropped once opacities have been reset.
const MAX_SCREEN_RADIUS: f32 = 20.0;
/// Gaussians larger than this share of the scene's extent are dropped once opacities have been reset.
const MAX_EXTENT_SHARE: f32 = 0.1;

impl Trainer {
    /// Drops the Gaussians that contribute least to the training views at their times (STP, paper III-B).
    pub(super) fn prune_insignificant(&mut self, iteration: usize) {
        let config = &self.config.train.prune;
        // Off the tape, which would hold on to every picture's tensors until the next backward pass.
        let scene = self.state.scene.valid();
        let splatter = self.splatter(Stage::Fine, iteration);
        let mut significance = Significance::new(scene.gaussians.len());
        for frame in self.pruning_views(iteration) {
            significance.add(&splatter, scene.at(frame.time), &frame.camera);
        }
        let volumes: Vec<f64> = scene.gaussians.log_scales.val().sum_dim(1).exp().into_data().iter::<f64>().collect();
        let mut scores = significance.scores(config.score());
        for (score, factor) in scores.iter_mut().zip(config.volume_weight().of(&volumes)) {
            *score *= factor;
        }
        let keep: Vec<bool> = least_significant(&scores, config.fraction).iter().map(|drop| !drop).collect();
        // Never everything: an empty scene has no gradient to come back from.
        if keep.contains(&true) && keep.contains(&false) {
            prune(&mut self.state.scene.gaussians, &mut self.state.adam, &keep);
            self.state.statistics.keep(&keep);
        }
    }

    /// Every training view, or one random view a time.
    fn pruning_views(&self, iteration: usize) -> Vec<&Frame> {
        if !self.config.train.prune.one_camera_per_time {
            return self.data.train.iter().collect();
        }
        let mut by_time: BTreeMap<u32, Vec<&Frame>> = BTreeMap::new();
        for frame in &self.data.train {
            by_time.entry(frame.time.to_bits()).or_default().push(frame);
        }
        let mut generator = generator(self.config.seed, Purpose::PruningViews, Stage::Fine, iteration);
        by_time.into_values().map(|views| views[generator.random_range(0..views.len())]).collect()
    }

    pub(super) fn control_density(&mut self, stage: Stage, iteration: usize) {
        let config = self.config.train.densify.clone();
        if iteration > config.until {
            return;
        }
        let progress = iteration as f32 / config.until.max(1) as f32;
        let between = |from: f32, to: f32| from + (to - from) * progress;
        let (threshold, min_opacity) = match stage {
            Stage::Coarse => (config.grad_threshold_coarse, config.opacity_threshold),
            Stage::Fine => (
                between(config.grad_threshold_fine_init, config.grad_threshold_fine_final),
                between(config.opacity_threshold_fine_init, config.opacity_threshold_fine_final),
            ),
        };
        let due = |from: usize, interval: usize| interval > 0 && iteration > from && iteration.is_multiple_of(interval);
        let extent = self.data.extent;

        let count = self.state.scene.gaussians.len();
        if due(config.prune_from, config.prune_interval) && count > config.prune_above {
            let size_limit = (config.opacity_reset_interval > 0 && iteration > config.opacity_reset_interval)
                .then_some(SizeLimit { max_radius: MAX_SCREEN_RADIUS, max_scale: MAX_EXTENT_SHARE * extent });
            let gaussians = &self.state.scene.gaussians;
            let keep = survivors(gaussians, min_opacity, size_limit, &self.state.statistics.largest_radius);
            // Never everything: an empty scene has no gradient to come back from.
            if keep.contains(&true) && keep.contains(&false) {
                prune(&mut self.state.scene.gaussians, &mut self.state.adam, &keep);
                self.state.statistics.keep(&keep);
            }
        }
        if due(config.from, config.interval) && self.state.scene.gaussians.len() < config.max_gaussians {
            let gaussians = &self.state.scene.gaussians;
            let masks = DensifyMasks::new(
                &self.state.statistics.mean_gradients(),
                &largest_scales(gaussians),
                threshold,
                config.percent_dense * extent,
            );
            let mut generator = generator(self.config.seed, Purpose::Split, stage, iteration);
            let normals: Vec<f32> = (0..masks.normals_needed()).map(|_| standard_normal(&mut generator)).collect();
            densify(&mut self.state.scene.gaussians, &mut self.state.adam, &masks, &normals);
            self.reset_statistics();
        }
        if due(0, config.opacity_reset_interval) && iteration < config.until {
            reset_opacity(&mut self.state.scene.gaussians, &mut self.state.adam);
        }
    }
}
