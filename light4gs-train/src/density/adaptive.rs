//! Adaptive density control (3DGS, Kerbl et al. 2023, section 5.2), with the thresholds of 4DGS that change over the fine
//! stage.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor};
use light4gs_keys::Bounds::{Number, Whole};
use light4gs_keys::{INTERVAL, ITERATION, SHARE, THRESHOLD, keys};

use super::clone_and_split::{
    DensifyMasks, SizeLimit, densify, largest_scales, least_of_largest, reset_opacity, survivors,
};
use super::{
    DensityConfig, DensityStatistics, DensityStrategy, GaussianEditor, MOST_GAUSSIANS, TrainingPosition,
    ViewStatistics, gaussians_for_images,
};
use crate::randomness::standard_normal;
use crate::stage::Stage;

/// Gaussians larger than this on the screen, in pixels, are dropped once opacities have been reset.
const MAX_SCREEN_RADIUS: f32 = 20.0;
/// Gaussians larger than this share of the scene's extent are dropped once opacities have been reset.
const MAX_EXTENT_SHARE: f32 = 0.1;

keys! {
    /// Adaptive density control (3DGS). Iterations are counted from 1 in each stage.
    pub struct AdaptiveDensityConfig {
        /// Cloning and splitting start after this iteration.
        from: usize = 500; ITERATION, "3DGS";
        /// Gaussians are cloned, split, and removed for being faint, up to and including this iteration. Opacity resets end
        /// before this iteration.
        until: usize = 15_000; ITERATION, "reference; the paper says 14000";
        /// Number of iterations from one round of cloning and splitting to the next.
        interval: usize = 100; INTERVAL, "reference";
        /// Screen-space gradient (in half-image units) above which a Gaussian is cloned or split in the coarse stage.
        grad_threshold_coarse: f32 = 2e-4; THRESHOLD, "3DGS";
        /// Threshold at the start of the fine stage: a Gaussian with a larger screen-space gradient is cloned or split.
        grad_threshold_fine_init: f32 = 2e-4; THRESHOLD, "reference";
        /// Threshold at the iteration `until` of the fine stage: a Gaussian with a larger screen-space gradient is
        /// cloned or split. Up to this iteration, the threshold changes linearly from `grad_threshold_fine_init`.
        grad_threshold_fine_final: f32 = 2e-4; THRESHOLD, "reference";
        /// Gaussians whose largest scale is at most this share of the scene's extent are cloned, and larger ones are
        /// split in two.
        percent_dense: f32 = 0.01; Number { least: 1e-9, most: 1e9 }, "3DGS";
        /// Largest number of Gaussians. If cloning and splitting would exceed this bound, only the Gaussians with the
        /// largest gradients are cloned or split.
        max_gaussians: usize = 360_000; Whole { least: 1, most: MOST_GAUSSIANS }, "reference; the largest first: ours";
        /// Opacity below which a Gaussian counts as faint and is removed, in the coarse stage.
        opacity_threshold: f32 = 0.005; SHARE, "3DGS";
        /// Threshold at the start of the fine stage: a Gaussian with a lower opacity counts as faint and is removed.
        opacity_threshold_fine_init: f32 = 0.005; SHARE, "reference";
        /// Threshold at the iteration `until` of the fine stage: a Gaussian with a lower opacity counts as faint and
        /// is removed. Up to this iteration, the threshold changes linearly from `opacity_threshold_fine_init`.
        opacity_threshold_fine_final: f32 = 0.005; SHARE, "reference";
        /// The removal of faint Gaussians starts after this iteration.
        prune_from: usize = 500; ITERATION, "reference";
        /// Iterations between two removals of faint Gaussians.
        prune_interval: usize = 100; INTERVAL, "reference";
        /// Faint Gaussians are removed only if there are more Gaussians than this. While there are fewer Gaussians, the
        /// faint ones are kept too, so that fast objects survive the coarse stage, in which they are faint. 0 means
        /// that faint Gaussians are always removed.
        prune_above: usize = 200_000;
            ITERATION, "reference: 200000";
        /// Iterations between two resets of the opacities; 0 = never.
        opacity_reset_interval: usize = 3000; ITERATION, "3DGS";
    }
}

impl DensityConfig for AdaptiveDensityConfig {
    fn strategy(&self) -> Box<dyn DensityStrategy> {
        Box::new(AdaptiveDensityControl::new(self.clone()))
    }

    fn end(&self) -> usize {
        self.until
    }

    fn max_gaussians(&self) -> Option<usize> {
        Some(self.max_gaussians)
    }

    fn problem(&self) -> Option<(&'static str, String)> {
        let problem = || format!("is {}, after `train.densify.adaptive.until`, which is {}", self.from, self.until);
        (self.from > self.until).then(|| ("from", problem()))
    }
}

/// Clones small Gaussians and splits large ones where the screen-space gradient is large, removes transparent and
/// oversized ones, resets opacities. The default.
#[derive(Debug)]
pub struct AdaptiveDensityControl {
    config: AdaptiveDensityConfig,
    /// Empty before the first stage.
    statistics: Option<DensityStatistics>,
}

impl AdaptiveDensityControl {
    /// With the thresholds and intervals of a configuration.
    pub fn new(config: AdaptiveDensityConfig) -> Self {
        Self { config, statistics: None }
    }

    /// The smallest gradient at which Gaussians are cloned or split, and the smallest opacity that is kept.
    fn thresholds(&self, position: &TrainingPosition) -> (f32, f32) {
        let config = &self.config;
        let progress = position.iteration as f32 / config.until.max(1) as f32;
        let between = |from: f32, to: f32| from + (to - from) * progress;
        match position.stage {
            Stage::Coarse => (config.grad_threshold_coarse, config.opacity_threshold),
            Stage::Fine => (
                between(config.grad_threshold_fine_init, config.grad_threshold_fine_final),
                between(config.opacity_threshold_fine_init, config.opacity_threshold_fine_final),
            ),
        }
    }

    /// The most Gaussians; smaller images need fewer.
    fn most(&self, position: &TrainingPosition) -> usize {
        gaussians_for_images(self.config.max_gaussians, 1.0 / f64::from(position.image_factor))
    }

    fn prune(&mut self, gaussians: &mut GaussianEditor, min_opacity: f32, position: &TrainingPosition) {
        let Some(statistics) = &self.statistics else { return };
        let interval = self.config.opacity_reset_interval;
        let size_limit = (interval > 0 && position.iteration > interval)
            .then_some(SizeLimit { max_radius: MAX_SCREEN_RADIUS, max_scale: MAX_EXTENT_SHARE * position.extent });
        let keep = survivors(gaussians.gaussians(), min_opacity, size_limit, &statistics.largest_radius);
        // Never all Gaussians: an empty scene has no gradient and could not recover.
        if keep.contains(&true) && keep.contains(&false) {
            gaussians.keep(&keep);
            self.rows_kept(&keep);
        }
    }

    fn clone_and_split(&mut self, gaussians: &mut GaussianEditor, threshold: f32, position: &TrainingPosition) {
        let Some(statistics) = &self.statistics else { return };
        let gradients = statistics.mean_gradients();
        // Each that is cloned or split adds one.
        let room = self.most(position).saturating_sub(gaussians.len());
        let masks = DensifyMasks::new(
            &gradients,
            &largest_scales(gaussians.gaussians()),
            threshold.max(least_of_largest(&gradients, room)),
            self.config.percent_dense * position.extent,
        );
        let mut generator = position.generator();
        let normals: Vec<f32> = (0..masks.normals_needed()).map(|_| standard_normal(&mut generator)).collect();
        densify(gaussians, &masks, &normals);
        let device = gaussians.gaussians().means.device().inner();
        self.begin_stage(gaussians.len(), &device);
    }
}

impl DensityStrategy for AdaptiveDensityControl {
    fn begin_stage(&mut self, count: usize, device: &Device) {
        self.statistics = Some(DensityStatistics::new(count, device));
    }

    fn after_backward(&mut self, views: &[ViewStatistics], position: &TrainingPosition) {
        if self.is_over(position.stage, position.iteration.saturating_sub(1)) {
            return;
        }
        let Some(statistics) = &mut self.statistics else { return };
        for view in views {
            if let Some(gradient) = &view.screen_gradient {
                statistics.add(gradient.clone(), view.radii.clone());
            }
        }
    }

    fn after_step(&mut self, gaussians: &mut GaussianEditor, position: &TrainingPosition) {
        let AdaptiveDensityConfig { from, until, interval, prune_from, prune_interval, .. } = self.config;
        let iteration = position.iteration;
        if iteration > until {
            return;
        }
        let (threshold, min_opacity) = self.thresholds(position);
        let due = |from: usize, interval: usize| interval > 0 && iteration > from && iteration.is_multiple_of(interval);
        if due(prune_from, prune_interval) && gaussians.len() > self.config.prune_above {
            self.prune(gaussians, min_opacity, position);
        }
        if due(from, interval) && gaussians.len() < self.most(position) {
            self.clone_and_split(gaussians, threshold, position);
        }
        if due(0, self.config.opacity_reset_interval) && iteration < until {
            reset_opacity(gaussians);
        }
    }

    fn rows_kept(&mut self, keep: &[bool]) {
        if let Some(statistics) = &mut self.statistics {
            statistics.keep(keep);
        }
    }

    fn is_over(&self, _: Stage, iteration: usize) -> bool {
        iteration >= self.config.until
    }

    fn state(&self) -> BTreeMap<String, Tensor<1>> {
        let Some(DensityStatistics { gradient_sum, views, largest_radius }) = &self.statistics else {
            return BTreeMap::new();
        };
        let named = [("gradient_sum", gradient_sum), ("views", views), ("largest_radius", largest_radius)];
        named.into_iter().map(|(name, tensor)| (name.to_owned(), tensor.clone())).collect()
    }

    fn restore(&mut self, mut state: BTreeMap<String, Tensor<1>>, count: usize) -> Result<(), String> {
        let mut take = |name: &str| {
            let wrong = |what: String| format!("tensor `density.{name}` {what}");
            let tensor = state.remove(name).ok_or_else(|| wrong("is missing".to_owned()))?;
            match tensor.dims() {
                [found] if found == count => {}
                [found] => return Err(wrong(format!("has {found} values, expected {count}, one per Gaussian"))),
            }
            match tensor.to_data().iter::<f32>().find(|value| *value < 0.0) {
                Some(value) => Err(wrong(format!("has the value {value}, expected none below 0"))),
                None => Ok(tensor),
            }
        };
        self.statistics = Some(DensityStatistics {
            gradient_sum: take("gradient_sum")?,
            views: take("views")?,
            largest_radius: take("largest_radius")?,
        });
        match state.keys().next() {
            Some(name) => Err(format!("tensor `density.{name}` belongs to no statistic of the density control")),
            None => Ok(()),
        }
    }
}
