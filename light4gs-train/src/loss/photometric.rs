//! L1, squared difference and D-SSIM (3DGS, Kerbl et al. 2023, equation 7).

use burn::tensor::Tensor;
use light4gs_keys::{ITERATION, SHARE, keys};

use super::{Loss, LossInput};
use crate::metrics::{l1, l1_in_parts, l2_in_parts, ssim};
use crate::stage::Stage;

keys! {
    /// `(1 - lambda) · L1 + lambda · (1 - SSIM)`, or the squared difference in the first iterations. This is the
    /// default loss.
    pub struct PhotometricLoss {
        /// The weight lambda of `1 - SSIM` in the loss. The weight of L1 is `1 - lambda`.
        lambda_dssim: f32 = 0.0; SHARE, "reference";
        /// The loss is the squared difference until this iteration of the fine stage, and in the whole coarse stage. 0
        /// means never. The squared difference is for fast objects: with L1, a pixel tends to its median color over
        /// time, and where a fast object passes, the median is the color of the background.
        l2_until: usize = 0; ITERATION, "ours";
    }
}

impl Loss for PhotometricLoss {
    fn loss(&self, view: LossInput) -> Tensor<1> {
        let squared = self.l2_until > 0 && (view.stage == Stage::Coarse || view.iteration <= self.l2_until);
        match squared {
            true => l2_in_parts(view.image, view.truth),
            false => photometric(view.image, view.truth, self.lambda_dssim),
        }
    }
}

/// `(1 - lambda) · L1 + lambda · (1 - SSIM)` of images `[H, W, 3]` in [0, 1], in parts that are to be added up.
pub fn photometric(image: Tensor<3>, truth: Tensor<3>, lambda_dssim: f32) -> Tensor<1> {
    if lambda_dssim == 0.0 {
        return l1_in_parts(image, truth);
    }
    let similarity = ssim(image.clone(), truth.clone());
    l1(image, truth) * (1.0 - lambda_dssim) + (similarity.neg() + 1.0) * lambda_dssim
}
