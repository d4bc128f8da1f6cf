//! `check`, and what `train` says about its dataset.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use light4gs_data::{
    CameraCurve, CaptureSummary, DataError, ImageStore, KnownCopy, Layouts, RgbImage8, Scene, camera_curves,
    write_atomically,
};
use light4gs_report::capture_page;
use light4gs_train::config::Config;
use light4gs_train::dataset::{image_store, load_options};
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};
use serde::Serialize;

use super::output::{say, say_json, tell};

/// Images that are looked at.
const CURVE_IMAGES: usize = 240;
/// Images of the contact sheet.
const SHEET_IMAGES: usize = 24;
/// Longer side of a picture on the contact sheet, pixels.
const SHEET_SIDE: u32 = 192;

#[derive(Debug, Args)]
pub(super) struct Check {
    /// Folder of the dataset.
    scene: PathBuf,
    /// Layout of the dataset; if this option is not given, the layout is found by content (see docs/data.md).
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Layouts::default().names()))]
    format: Option<String>,
    /// Changes one key of the configuration, such as data.times=order; may be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Write a page that shows cameras and points from above, and a contact sheet. For each camera, the page also says
    /// how much its images change and how sharp they are.
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Checked<'a> {
    #[serde(flatten)]
    capture: &'a CaptureSummary,
    /// What the images of each camera are like over time.
    cameras: &'a [CameraCurve],
    /// The published scene of which this is a copy.
    known: Option<&'a KnownCopy>,
}

impl Check {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if let Some(page) = &self.html {
            super::check_output(page, &self.scene)?;
        }
        let layouts = Layouts::default();
        let layout = match &self.format {
            Some(name) => layouts.by_name(name)?,
            None => layouts.detect(&self.scene)?,
        };
        let mut overrides = self.overrides;
        overrides.push(format!("data.layout={}", layout.name()));
        let config = Config::load(Config::preset_of(layout)?, &overrides)?;
        let scene = Scene::open(&self.scene, &load_options(&config))?;
        let store = image_store(&config);
        let (capture, curves) = understand(&store, &scene)?;
        let known = KnownCopy::of(&self.scene);
        if let Some(page) = &self.html {
            let html = capture_page(&scene, &capture, &curves, &contact_sheet(&store, &scene)?)?;
            write_atomically(page, |out| std::io::Write::write_all(out, html.as_bytes()))?;
        }
        if self.json {
            say_json(&Checked { capture: &capture, cameras: &curves, known: known.as_ref() })?;
        } else {
            say(table(&capture))?;
            if let Some(copy) = &known {
                say(format_args!("known: {copy}"))?;
            }
            remarks(&capture).try_for_each(say)?;
            if let Some(page) = &self.html {
                say(format_args!("page: {}", page.display()))?;
            }
        }
        refuse_problems(&self.scene, &capture)
    }
}

/// What a dataset is taken for, with its faults, and the curves that show them. Images are decoded for it.
pub(super) fn understand(store: &ImageStore, scene: &Scene) -> Result<(CaptureSummary, Vec<CameraCurve>), DataError> {
    let curves = camera_curves(scene, store, CURVE_IMAGES)?;
    Ok((CaptureSummary::of(scene)?.with_faults(scene, &curves), curves))
}

/// Prints what a dataset is taken for: a table on a terminal, a line on a log.
pub(super) fn tell_capture(capture: &CaptureSummary) {
    if std::io::IsTerminal::is_terminal(&std::io::stderr()) {
        tell(table(capture));
    } else {
        tell(format_args!("capture: {}", capture.line()));
    }
    remarks(capture).for_each(tell);
}

/// Notes and faults, one on a line.
fn remarks(capture: &CaptureSummary) -> impl Iterator<Item = String> {
    let kinds = [("note", &capture.notes), ("advice", &capture.faults)];
    kinds.into_iter().flat_map(|(kind, texts)| texts.iter().map(move |text| format!("{kind}: {text}")))
}

/// An error where training could only fail.
pub(super) fn refuse_problems(scene: &Path, capture: &CaptureSummary) -> Result<(), TrainError> {
    if capture.problems.is_empty() {
        return Ok(());
    }
    Err(TrainError::Input(format!("{}: {}", scene.display(), capture.problems.join("; "))))
}

fn table(capture: &CaptureSummary) -> Table {
    let mut table = Table::new([("capture", Align::Left), ("understood as", Align::Left)]);
    for fact in &capture.facts {
        table.row([&fact.what, &fact.found]);
    }
    table
}

/// Small images, evenly chosen, in order of time.
fn contact_sheet(store: &ImageStore, scene: &Scene) -> Result<Vec<(String, RgbImage8)>, DataError> {
    let mut frames: Vec<_> = scene.train.iter().chain(&scene.test).filter(|frame| frame.has_image()).collect();
    frames.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.camera_id.cmp(&b.camera_id)));
    let chosen = frames.iter().step_by(frames.len().div_ceil(SHEET_IMAGES).max(1));
    let small = |frame: &&&light4gs_data::Frame| {
        let image = store.get(frame)?;
        let factor = image.width.max(image.height).div_ceil(SHEET_SIDE).clamp(1, image.width.min(image.height).max(1));
        Ok((format!("{}, time {:.3}", frame.name, frame.time), image.reduced(factor)))
    };
    chosen.map(|frame| small(&frame)).collect()
}
