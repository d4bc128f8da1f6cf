//! Pruning by significance (STP, paper III-B).

use std::borrow::Cow;
use std::collections::BTreeMap;

use burn::module::Module;
use light4gs_data::Frame;
use light4gs_model::{DeformationField, Sensitivity, Significance, least_significant};
use rand::Rng;

use super::Trainer;
use crate::compression::EntropyModels;
use crate::density::{GaussianContributions, GaussianEditor};
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Drops the Gaussians that contribute least to the training views at their times.
    pub(super) fn prune_insignificant(&mut self, iteration: usize) {
        // Without a tape, which would keep every view's tensors until the next backward pass.
        let scene = self.state.scene.valid();
        let splatter = self.splatter(Stage::Fine, iteration);
        let count = scene.gaussians.len();
        let mut sums = Significance::new(count);
        let mut sensitivity = self.significance.reads_sensitivity().then(|| Sensitivity::new(count));
        let mut seeds = generator(self.config.seed, Purpose::PruningViews, Stage::Fine, iteration);
        for frame in self.pruning_views(iteration) {
            let frame = self.as_trained(iteration, frame);
            let gaussians = scene.at(frame.time);
            if let Some(sensitivity) = &mut sensitivity {
                sensitivity.add(&splatter, gaussians.clone(), &frame.camera, seeds.random());
            }
            sums.add(&splatter, gaussians, &frame.camera);
        }
        let volumes: Vec<f64> = scene.gaussians.log_scales.val().sum_dim(1).exp().into_data().iter::<f64>().collect();
        let contributions = GaussianContributions::new(&sums, sensitivity.as_ref(), volumes);
        let scores = self.significance.scores(&contributions);
        let drop = least_significant(&scores, self.config.train.prune.fraction);
        let keep: Vec<bool> = drop.iter().map(|drop| !drop).collect();
        // Never all Gaussians: an empty scene has no gradient and could not recover.
        if keep.contains(&true) && keep.contains(&false) {
            GaussianEditor::new(&mut self.state.scene.gaussians, &mut self.state.adam).keep(&keep);
            self.density.rows_kept(&keep);
        }
    }

    /// A training frame with its corrected camera and time after an iteration of the fine stage.
    pub(super) fn as_trained(&self, iteration: usize, frame: usize) -> Cow<'_, Frame> {
        let given = &self.data.train[frame];
        match self.correction(Stage::Fine, iteration, frame) {
            Some(correction) => Cow::Owned(correction.frame(given)),
            None => Cow::Borrowed(given),
        }
    }

    /// Every training view, or one random view for each time, by their indices in the training split.
    fn pruning_views(&self, iteration: usize) -> Vec<usize> {
        match self.config.train.prune.one_camera_per_time {
            true => self.one_view_per_time(Purpose::PruningViews, iteration),
            false => (0..self.data.train.len()).collect(),
        }
    }

    /// One random training view for each time, by their indices in the training split.
    pub(super) fn one_view_per_time(&self, purpose: Purpose, iteration: usize) -> Vec<usize> {
        let mut by_time: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (index, frame) in self.data.train.iter().enumerate() {
            by_time.entry(frame.time.to_bits()).or_default().push(index);
        }
        let mut generator = generator(self.config.seed, purpose, Stage::Fine, iteration);
        by_time.into_values().map(|views| views[generator.random_range(0..views.len())]).collect()
    }
}
