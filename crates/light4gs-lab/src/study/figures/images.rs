//! Test views of all variants, side by side.

use std::path::Path;

use light4gs_data::{RgbImage8, Scene};
use light4gs_train::dataset::{ImageSource, image_store, load_options};
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;

use super::{Content, Figure};
use crate::study::manifest::{Manifest, StudyFolder};
use crate::study::results::RunResult;

/// The middle frame of the test split, for each run that has saved its images; before them the true image, if the
/// dataset still exists.
pub(super) fn side_by_side(
    folder: &StudyFolder,
    manifest: &Manifest,
    scene: usize,
    runs: &[(String, &RunResult)],
) -> Result<Option<Figure>, TrainError> {
    let named = &manifest.scenes[scene];
    let renders = |run: &RunResult| folder.path(&run.run).join("renders/test");
    let Some(name) = runs.iter().find_map(|(_, run)| middle_name(&renders(run))) else { return Ok(None) };
    let mut images = Vec::new();
    if let Some((_, run)) = runs.first() {
        let (_, _, config) = RunFolder::open(&folder.path(&run.run))?;
        let truth = Scene::open(&named.path, &load_options(&config)).ok().and_then(|scene| {
            let frame = scene.test.iter().find(|frame| format!("{}.png", frame.name) == name)?;
            Some((*image_store(&config).image(frame).ok()?).clone())
        });
        images.extend(truth.map(|truth| ("ground truth".to_owned(), truth)));
    }
    for (label, run) in runs {
        if let Some(image) = read(&renders(run).join(&name)) {
            images.push((label.clone(), image));
        }
    }
    let (view, seed) = (name.trim_end_matches(".png"), if manifest.seeds > 1 { " of the first seed" } else { "" });
    Ok(Some(Figure {
        section: "Images",
        name: format!("images-{}", named.name),
        caption: format!("{}: test view {view}, from the decoded files{seed}.", named.name),
        content: Content::Images(images),
    }))
}

/// The name of the image in the middle of a folder's list.
fn middle_name(folder: &Path) -> Option<String> {
    let names = std::fs::read_dir(folder).ok()?.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".png") && !name.starts_with('.')).collect();
    names.sort();
    names.get(names.len() / 2).cloned()
}

/// An image that an evaluation wrote; `None` if it does not exist.
fn read(path: &Path) -> Option<RgbImage8> {
    let image = image::open(path).ok()?.into_rgb8();
    Some(RgbImage8 { width: image.width(), height: image.height(), pixels: image.into_raw() })
}
