//! The effect of pruning: the first and the last frame, and the Gaussians that draw them.

use burn::tensor::Device;
use light4gs_data::{Frame, RgbImage8, RgbImage32, Scene};
use light4gs_model::Splatter;
use light4gs_train::dataset::load_options;
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::DecodedScene;
use light4gs_train::run::RunFolder;

use super::{Content, Figure};
use crate::study::manifest::{Manifest, StudyFolder};
use crate::study::results::RunResult;

/// Primitives are drawn with this share of their size, so that they can be told apart...
const SHRINK: f32 = 0.4;
/// ...and with this opacity logit.
const OPAQUE: f32 = 5.0;

/// One figure for each of the two frames: for each run the rendering, and the primitives as small opaque ellipsoids.
pub(super) fn figures(
    folder: &StudyFolder,
    manifest: &Manifest,
    scene: usize,
    runs: &[(String, &RunResult)],
) -> Result<Vec<Figure>, TrainError> {
    let named = &manifest.scenes[scene];
    let mut by_frame: Vec<(String, Vec<(String, RgbImage8)>)> = Vec::new();
    for (label, run) in runs {
        let (run_folder, _, config) = RunFolder::open(&folder.path(&run.run))?;
        let data = Scene::open(&named.path, &load_options(&config))?;
        let device = device::open(config.device)?;
        let decoded: DecodedScene = DecodedScene::open(&run_folder.stream(), &device)?;
        for (index, (moment, frame)) in first_and_last(&data).into_iter().enumerate() {
            if by_frame.len() <= index {
                by_frame.push((moment.to_owned(), Vec::new()));
            }
            let images = &mut by_frame[index].1;
            images.push((format!("{label}: {} Gaussians", run.gaussians), decoded.render(frame).to_u8()));
            images.push((format!("{label}: primitives"), primitives(&decoded, frame, &device)));
        }
    }
    let figure = |(moment, images): (String, Vec<(String, RgbImage8)>)| Figure {
        section: "Pruned and unpruned",
        name: format!("primitives-{}-{moment}", named.name),
        caption: format!(
            "{}: {moment} frame, rendered, and its primitives at {SHRINK} of their size and opaque.",
            named.name
        ),
        content: Content::Images(images),
    };
    Ok(by_frame.into_iter().map(figure).collect())
}

/// The earliest and the latest frame of the test split, or of the training split where there is none.
fn first_and_last(data: &Scene) -> [(&'static str, &Frame); 2] {
    let frames = if data.test.is_empty() { &data.train } else { &data.test };
    let by_time = |a: &&Frame, b: &&Frame| a.time.total_cmp(&b.time);
    let first = frames.iter().min_by(by_time).expect("a scene has frames");
    let last = frames.iter().max_by(by_time).expect("a scene has frames");
    [("first", first), ("last", last)]
}

fn primitives(decoded: &DecodedScene, frame: &Frame, device: &Device) -> RgbImage8 {
    let splatter = Splatter::new(decoded.data.meta.background, usize::from(decoded.data.gaussians.sh_degree));
    let mut gaussians = decoded.model.at(frame.time);
    gaussians.log_scales = gaussians.log_scales + SHRINK.ln();
    gaussians.opacity_logits = gaussians.opacity_logits.zeros_like() + OPAQUE;
    let image = splatter.render(gaussians, &frame.camera, None).image;
    let pixels = image.clamp(0.0, 1.0).to_device(device).into_data().iter::<f32>().collect();
    RgbImage32 { width: frame.camera.width, height: frame.camera.height, pixels }.to_u8()
}
