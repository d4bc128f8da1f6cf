//! Corrections of the training by the file of its scene so far, which is encoded once for all of them.

use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::{EntropyModels, encoded_so_far};
use crate::dataset::scene_meta;
use crate::error::TrainError;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Corrects the expected bits and the weight of the rate, where that is due. Neither changes the file of this scene.
    ///
    /// # Errors
    /// A test image that cannot be read.
    pub(super) fn follow_file(&mut self, iteration: usize) -> Result<(), TrainError> {
        let [corrects, steers] = [self.correction_is_due(iteration), self.steering_is_due(iteration)];
        let Some(compression) = self.state.compression.as_ref().filter(|_| corrects || steers) else { return Ok(()) };
        let meta = scene_meta(&self.config, &self.data);
        // A scene that cannot be coded has diverged, and the trainer says so.
        let encoded = encoded_so_far(&self.state.scene, compression, meta, &self.config.compression);
        let Ok(file) = encoded else { return Ok(()) };
        if corrects {
            self.correct_expected_bits(&file);
        }
        if steers {
            self.steer_rate(&file, iteration)?;
        }
        self.profile.lap("size of the file");
        Ok(())
    }
}
