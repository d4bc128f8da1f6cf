//! The views of a training step. Each has a tape of its own, so that they can be rendered and differentiated side by side.

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use light4gs_data::{Frame, ImageStore};
use light4gs_model::{DynamicScene, Splatter};

use super::image_tensor;
use crate::error::TrainError;
use crate::gradients::GradientSums;
use crate::loss::{l2, photometric};
use crate::metrics_log::Stage;
use crate::profile::Profile;

/// What the views of a step have in common.
pub(super) struct ViewPass<'a> {
    pub(super) stage: Stage,
    pub(super) splatter: Splatter,
    pub(super) images: &'a ImageStore,
    pub(super) device: &'a Device,
    /// Whether the loss is squared.
    pub(super) squared: bool,
    pub(super) lambda_dssim: f32,
    /// Of a view in the loss.
    pub(super) weight: f32,
}

/// What a view adds to a step. All tensors are off the tape.
pub(super) struct View {
    /// `[1]`: its weighted part of the loss.
    pub(super) loss: Tensor<1>,
    /// Of that part by the scene's parameters.
    pub(super) gradients: GradientSums,
    /// `[N, 2]`: of that part by the Gaussians' places in the picture.
    pub(super) screen_gradient: Option<Tensor<2>>,
    /// `[N]` in pixels.
    pub(super) radii: Tensor<1, Int>,
    /// `[H, W, 3]`
    pub(super) image: Tensor<3>,
    /// `[H, W, 3]`
    pub(super) truth: Tensor<3>,
}

impl ViewPass<'_> {
    /// Renders and differentiates every frame, `threads` at a time. The outcome, in the order of the frames, does not
    /// depend on that number.
    pub(super) fn run<'f>(
        &self,
        scene: &DynamicScene,
        frames: &[&'f Frame],
        threads: usize,
        profile: &Profile,
    ) -> Result<Vec<View>, TrainError> {
        // Copies share the scene's memory; each begins a tape of its own.
        let with_copies = |frames: &[&'f Frame]| -> Vec<_> {
            frames.iter().map(|frame| (scene.clone().fork(self.device), *frame)).collect()
        };
        if threads <= 1 {
            return self.views(with_copies(frames), profile);
        }
        // Threads of their own, not rayon's: a worker of rayon's that waits inside a view would begin another one meanwhile.
        std::thread::scope(|scope| {
            let shares = frames.chunks(frames.len().div_ceil(threads)).map(with_copies);
            let workers: Vec<_> = shares.map(|share| scope.spawn(move || self.views(share, &Profile::off()))).collect();
            let mut views = Vec::with_capacity(frames.len());
            for worker in workers {
                views.extend(worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
            }
            Ok(views)
        })
    }

    fn views(&self, tasks: Vec<(DynamicScene, &Frame)>, profile: &Profile) -> Result<Vec<View>, TrainError> {
        tasks.into_iter().map(|(scene, frame)| self.view(scene, frame, profile)).collect()
    }

    fn view(&self, mut scene: DynamicScene, frame: &Frame, profile: &Profile) -> Result<View, TrainError> {
        let gaussians = match self.stage {
            Stage::Coarse => scene.gaussians.tensors(),
            Stage::Fine => scene.at(frame.time),
        };
        profile.lap("Gaussians at the time");
        let offsets = Tensor::<2>::zeros([scene.gaussians.len(), 2], self.device).require_grad();
        let rendering = self.splatter.render(gaussians, &frame.camera, Some(offsets.clone()));
        profile.lap("splatting");
        let truth = image_tensor(&*self.images.get(frame)?, self.device);
        profile.lap("picture from disk");
        let image = rendering.image;
        let loss = if self.squared {
            l2(image.clone(), truth.clone())
        } else {
            photometric(image.clone(), truth.clone(), self.lambda_dssim)
        };
        let loss = loss * self.weight;
        profile.lap("loss");
        let value = loss.clone().inner();
        let mut tape = loss.backward();
        let mut gradients = GradientSums::default();
        gradients.add_scene(&mut scene, &mut tape);
        profile.lap("backward");
        Ok(View {
            loss: value,
            gradients,
            screen_gradient: offsets.grad_remove(&mut tape),
            radii: rendering.radii,
            image: image.inner(),
            truth: truth.inner(),
        })
    }
}
