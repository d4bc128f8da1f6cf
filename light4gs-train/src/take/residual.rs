//! Where the images of a segment differ from the base behind it.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};
use light4gs_codec::GaussianArrays;
use light4gs_data::{Frame, RgbImage8, Scene};
use light4gs_model::{GaussianTensors, Gaussians, Splatter};

use crate::dataset::ImageSource;
use crate::error::TrainError;
use crate::metrics::{image_tensor, mask_tensor};

/// Views that are looked at, about.
const VIEWS: usize = 24;

/// A training view of a segment, and what of it the base does not explain.
#[derive(Debug)]
pub(super) struct Residual<'a> {
    /// The view.
    pub(super) frame: &'a Frame,
    /// `[H W]`: mean over the colors of the absolute difference; 0 where a mask says nothing about the image.
    pub(super) error: Vec<f32>,
    /// `[H W]`: depth of the base, world units; infinite where there is none.
    pub(super) depth: Vec<f32>,
    /// The image.
    pub(super) truth: Arc<RgbImage8>,
}

/// The views of a segment by which its base is judged: all cameras at some times of a rig, and some times of one camera.
pub(super) fn looked_at(data: &Scene) -> Vec<&Frame> {
    let mut times: Vec<u32> = data.train.iter().map(|frame| frame.time.to_bits()).collect();
    times.sort_unstable();
    times.dedup();
    let cameras = data.train.len().div_ceil(times.len().max(1)).max(1);
    let wanted = (VIEWS / cameras).clamp(3, VIEWS);
    let stride = times.len().div_ceil(wanted).max(1);
    let chosen: Vec<u32> = times.iter().copied().skip(stride / 2).step_by(stride).collect();
    let mut frames: Vec<&Frame> = data.train.iter().filter(|frame| chosen.contains(&frame.time.to_bits())).collect();
    frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    frames
}

/// The residuals of views, each with the Gaussians of a base alone. `device` is one without autodiff.
pub(super) fn residuals<'a>(
    base: &GaussianArrays,
    frames: &[&'a Frame],
    background: [f32; 3],
    images: &dyn ImageSource,
    device: &Device,
) -> Result<Vec<Residual<'a>>, TrainError> {
    let gaussians = Gaussians::from_arrays(base, device).tensors().inner();
    let splatter = Splatter::new(background, usize::from(base.sh_degree));
    frames.iter().map(|frame| residual(&gaussians, &splatter, frame, images, device)).collect()
}

fn residual<'a>(
    gaussians: &GaussianTensors,
    splatter: &Splatter,
    frame: &'a Frame,
    images: &dyn ImageSource,
    device: &Device,
) -> Result<Residual<'a>, TrainError> {
    let rendering = splatter.render(gaussians.clone(), &frame.camera, None);
    let truth = images.image(frame)?;
    let mut error = (rendering.image - image_tensor(&truth, device)).abs().mean_dim(2).squeeze_dim::<2>(2);
    if let Some(mask) = images.trained_pixels(frame)? {
        error = error * mask_tensor(&mask, device);
    }
    let [alpha, depth] = [rendering.alpha, rendering.depth].map(numbers);
    let depth = alpha.iter().zip(depth).map(|(alpha, depth)| if *alpha > 0.5 { depth / alpha } else { f32::INFINITY });
    Ok(Residual { frame, error: numbers(error), depth: depth.collect(), truth })
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter().collect()
}
