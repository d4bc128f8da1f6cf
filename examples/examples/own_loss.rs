//! A loss in your own crate: a smooth absolute difference for the colors, and a penalty on the outline of everything
//! that is in front of the background.
//!
//! A [`Loss`] gets a rendered view and its training image, and returns one number on the tape. The trainer does the
//! rest.

use burn::tensor::{Device, Tensor};
use light4gs::data::Scene;
use light4gs::model::{DynamicScene, Splatter};
use light4gs::train::dataset::{image_store, load_options};
use light4gs::train::loss::{Loss, LossInput};
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, image_tensor, tiny_config, tiny_scene};

/// `[H, W]`: 1 where an image `[H, W, 3]` shows something, 0 where it shows the white background.
fn silhouette(image: Tensor<3>) -> Tensor<2> {
    image.min_dim(2).squeeze_dim::<2>(2).lower_elem(0.99).float()
}

/// sqrt(difference² + ε²) for the colors, and a penalty where the rendered opacity differs from the silhouette.
struct SilhouetteLoss {
    weight: f32,
}

impl Loss for SilhouetteLoss {
    fn loss(&self, view: LossInput) -> Tensor<1> {
        let outline = (view.alpha - silhouette(view.truth.clone())).abs().mean();
        let colors = ((view.image - view.truth).powi_scalar(2) + 1e-4).sqrt().mean();
        colors + outline * self.weight
    }
}

/// Mean difference of rendered opacity and silhouette over the test views.
fn outline_error(scene: &DynamicScene, data: &Scene, device: &Device) -> Outcome<f32> {
    let store = image_store(&tiny_config()?);
    let splatter = Splatter::new(data.background, 3);
    let mut sum = 0.0;
    for frame in &data.test {
        let alpha = splatter.render(scene.at(frame.time), &frame.camera, None).alpha;
        let truth = image_tensor(&*store.get(frame)?, device);
        sum += (alpha - silhouette(truth)).abs().mean().into_scalar::<f32>();
    }
    Ok(sum / data.test.len() as f32)
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let config = tiny_config()?;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;
    let device = Device::flex().autodiff();

    // The same run twice: with the default loss, and with ours.
    let mut plain = Trainer::builder(config.clone(), data.clone()).build()?;
    while plain.step()?.is_some() {}
    let mut ours = Trainer::builder(config, data.clone()).loss(SilhouetteLoss { weight: 0.5 }).build()?;
    let mut losses = Vec::new();
    while let Some(step) = ours.step()? {
        losses.push(step.loss);
    }

    // It is trained: the loss falls.
    let (first, last) = first_and_last(&losses);
    println!("loss: {first:.3} in the first tenth of the run, {last:.3} in the last");
    assert!(last < 0.7 * first);
    // It has its intended effect: outlines are better than without it.
    let (with, without) = (outline_error(ours.scene(), &data, &device)?, outline_error(plain.scene(), &data, &device)?);
    println!("error of the outline: {with:.4} with the loss, {without:.4} without");
    assert!(with < without);

    // A function is a loss too.
    let squared = |view: LossInput| (view.image - view.truth).powi_scalar(2).mean();
    let mut short = Trainer::builder(tiny_config()?, data).loss(squared).build()?;
    assert!(short.step()?.is_some_and(|step| step.loss.is_finite()));
    Ok(())
}
