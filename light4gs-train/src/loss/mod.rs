//! Losses: how a rendered image is compared with the training image.
//!
//! [`PhotometricLoss`] is built in: L1, D-SSIM, and the squared difference in the first iterations. Any function of a
//! [`LossInput`] is a [`Loss`] too. [`LossKind`] has the built-in ones by name. For a term that does not compare images see
//! [`regularizer`](crate::regularizer).

mod photometric;

use burn::tensor::Tensor;
use light4gs_data::Frame;
use light4gs_keys::choice;

pub use photometric::{PhotometricLoss, photometric};

use crate::stage::Stage;

choice! {
    /// The built-in losses, by the names that `train.loss` takes.
    pub enum LossKind: "loss" {
        Photometric = photometric: PhotometricLoss,
    }
    /// The keys of the built-in losses.
    pub struct Losses: dyn Loss;
}

/// A rendered view, its training image, and the training position.
#[derive(Clone, Debug)]
pub struct LossInput<'a> {
    /// `[H, W, 3]`: as rendered over the background, on the tape; not clamped above.
    pub image: Tensor<3>,
    /// `[H, W]`: the rendered opacity in [0, 1], on the tape.
    pub alpha: Tensor<2>,
    /// `[H, W]`: view depth times blending weight, summed, world units, on the tape. Divide by `alpha` for a mean depth.
    pub depth: Tensor<2>,
    /// `[H, W, 3]`: the training image in [0, 1], over the same background.
    pub truth: Tensor<3>,
    /// The camera, the time and the name of the view.
    pub frame: &'a Frame,
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1.
    pub iteration: usize,
}

/// A differentiable measure of the error of a rendered view. Views are differentiated side by side on several threads,
/// so a loss must be `Sync`; state that it keeps between iterations belongs behind a lock.
pub trait Loss: Send + Sync {
    /// Numbers whose sum is the loss, on the tape of the rendered tensors: one, or several where their sum would take time.
    fn loss(&self, view: LossInput) -> Tensor<1>;
}

/// A function is a loss.
impl<L: Fn(LossInput) -> Tensor<1> + Send + Sync> Loss for L {
    fn loss(&self, view: LossInput) -> Tensor<1> {
        self(view)
    }
}
