//! The quality of a decoded scene, for a file with a wished PSNR (`compression.target_db`).

use burn::tensor::Device;
use light4gs_codec::SceneData;
use light4gs_data::{Frame, RgbImage32, Scene};
use light4gs_model::{DeformationField, DynamicScene, Splatter};

use crate::dataset::ImageSource;
use crate::error::TrainError;
use crate::metrics::{image_tensor, psnr};

/// The views by which a wished PSNR is measured: those of the test split, as in a report; where there are none, those of
/// training.
pub fn measured_views(data: &Scene) -> &[Frame] {
    if data.test.is_empty() { &data.train } else { &data.test }
}

/// Draws a decoded scene as an evaluation does: over its background, with all of its harmonics.
pub fn splatter_of(data: &SceneData) -> Splatter {
    Splatter::new(data.meta.background, usize::from(data.gaussians.sh_degree))
}

/// Mean PSNR over views, dB, of 8-bit renderings as an evaluation measures it. `splatter` draws them; `device` is one without
/// autodiff.
///
/// # Errors
/// [`TrainError::Model`] if `F` cannot be made from `data`; [`TrainError::Data`] for an image that cannot be read.
pub fn mean_psnr<'f, F: DeformationField>(
    data: &SceneData,
    splatter: &Splatter,
    views: impl IntoIterator<Item = &'f Frame>,
    images: &dyn ImageSource,
    device: &Device,
) -> Result<f64, TrainError> {
    let scene = DynamicScene::<F>::from_arrays(data, device)?;
    let mut values = Vec::new();
    for frame in views {
        let image = splatter.render(scene.at(frame.time), &frame.camera, None).image;
        let pixels = image.clamp(0.0, 1.0).into_data().iter::<f32>().collect();
        let render = RgbImage32 { width: frame.camera.width, height: frame.camera.height, pixels }.to_u8();
        let truth = images.image(frame)?;
        values.push(psnr(image_tensor(&render, device), image_tensor(&truth, device)));
    }
    Ok(values.iter().sum::<f64>() / values.len() as f64)
}
