//! `report.html`: the results of a run in one file that needs no other files.
//!
//! Style, script, charts (SVG) and images (PNG) are all inside, and the page forbids all requests. It can be read
//! without its script, in light and dark mode, on paper and with a screen reader.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | measure a finished run, and write its report | [`evaluate_run`] |
//! | write a report from results at hand | [`write_report`] with a [`Report`]; parts that are empty are left out |
//! | show a take over its seconds | [`take_page`] |
//! | write another page in the same style | [`page_of`] |
//! | show what a capture is taken for, before it is trained | [`capture_page`] |
//! | embed an image in HTML | [`data_uri`], with [`escape`] for texts and [`inferno`] for maps |
//! | give the player the cameras of a dataset | [`cameras_json`] |
//!
//! # Example
//!
//! ```
//! use light4gs_report::{Report, SummaryTile, write_report};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! let path = folder.path().join("report.html");
//! let tile = SummaryTile { label: "Test PSNR".into(), value: "33.1 dB".into(), ..Default::default() };
//! write_report(&path, &Report { title: "bouncing".into(), summary: vec![tile], ..Default::default() })?;
//! assert!(std::fs::read_to_string(&path).unwrap().contains("33.1 dB"));
//! # Ok::<(), light4gs_data::DataError>(())
//! ```

mod cameras;
mod capture;
mod chart;
mod coding;
mod color_map;
mod curves;
mod format;
mod html;
mod images;
mod quality;
mod run;
mod sizes;
mod take;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use light4gs_data::{CaptureSummary, DataError, write_atomically};
use light4gs_train::compression::{BitMap, CodingRecord};
use light4gs_train::evaluation::{RenderedView, SectionSize, SplitScore};
use light4gs_train::observers::metrics_log::MetricsRecord;
use light4gs_web::page::{Content, PLAYER, Place, element};

pub use cameras::cameras_json;
pub use capture::capture_page;
pub use color_map::inferno;
pub use html::escape;
use html::fill;
pub use images::data_uri;
pub use run::evaluate_run;
pub use take::take_page;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// The contents of a report. Empty parts are left out of the page.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Heading, such as the scene's name.
    pub title: String,
    /// The time at which the run ended, in a form for readers.
    pub created: String,
    /// Back end and machine.
    pub device: String,
    /// The figures at the top.
    pub summary: Vec<SummaryTile>,
    /// What to do about a run that came out badly.
    pub advice: Vec<String>,
    /// What the dataset was taken for.
    pub capture: CaptureSummary,
    /// Bytes of the file by section, in the order of the file.
    pub sections: Vec<SectionSize>,
    /// The file itself, to be played at the top of the page.
    pub player: Option<PlayerReport>,
    /// How the file was coded.
    pub coding: Option<CodingReport>,
    /// Quality by split.
    pub splits: Vec<SplitScore>,
    /// Views to show beside their ground truth; both images of one must have the same size.
    pub images: Vec<RenderedView>,
    /// The run's curves.
    pub metrics: Vec<MetricsRecord>,
    /// The configuration, as resolved.
    pub config_toml: String,
}

/// One figure at the top of a report.
#[derive(Debug, Clone, Default)]
pub struct SummaryTile {
    /// Its name: `Test PSNR`.
    pub label: String,
    /// The figure with its unit: `33.1 dB`.
    pub value: String,
    /// A short remark: `20 views, decoded file`; may be empty.
    pub hint: String,
}

/// The contents of a report's player.
#[derive(Debug, Clone)]
pub struct PlayerReport {
    /// A `.l4gs` stream.
    pub scene: Vec<u8>,
    /// Cameras as JSON, see [`cameras_json`].
    pub cameras: String,
}

/// How a file was coded.
#[derive(Debug, Clone)]
pub struct CodingReport {
    /// Expected and actual bits.
    pub record: CodingRecord,
    /// Maps of the planes' bits; may be empty.
    pub bit_maps: Vec<BitMap>,
}

/// Writes the report. The file is complete or absent; one that exists is replaced.
///
/// # Errors
/// [`DataError::Image`] if a render and its ground truth differ in size; [`DataError::Io`] naming `path`.
pub fn write_report(path: &Path, report: &Report) -> Result<(), DataError> {
    let page = page(path, report)?;
    write_atomically(path, |out| out.write_all(page.as_bytes()))
}

fn page(path: &Path, report: &Report) -> Result<String, DataError> {
    let advice: String = report.advice.iter().map(|advice| format!("<p>{}</p>\n", escape(advice))).collect();
    let sections = [
        section("advice", "Advice", advice),
        section("views", "Ground truth, render, error", images::section(path, &report.images)?),
        section("quality", "Quality", quality::section(&report.splits)),
        section("size", "Bytes of the file", sizes::section(&report.sections)),
        section("coding", "Entropy coding", coding::section(path, report.coding.as_ref())?),
        section("capture", "The capture", capture::section(&report.capture)),
        section("curves", "Training", curves::section(&report.metrics)),
        section("configuration", "Configuration", configuration(&report.config_toml)),
    ];
    Ok(fill(
        PAGE,
        &[
            ("title", &escape(&report.title)),
            ("about", &about(report)),
            ("tiles", &tiles(&report.summary)),
            ("player", &player(report.player.as_ref())),
            ("sections", &sections.concat()),
            ("style", STYLE),
            ("script", SCRIPT),
            ("module", if report.player.is_some() { PLAYER } else { "" }),
        ],
    ))
}

/// The player; nothing if there is no scene to play.
fn player(player: Option<&PlayerReport>) -> String {
    let Some(PlayerReport { scene, cameras }) = player else { return String::new() };
    let player = element(Content::Embedded { scene, cameras }, Place::Part);
    format!("<section class=\"player\" aria-label=\"The scene in motion\">\n{player}\n</section>\n")
}

/// A page in the style of the report, with sections of the caller's: pairs of a heading and HTML.
pub fn page_of(title: &str, about: &str, sections: &[(String, String)]) -> String {
    let sections = sections.iter().enumerate();
    let sections: String =
        sections.map(|(k, (heading, html))| section(&format!("s{k}"), &escape(heading), html.clone())).collect();
    fill(
        PAGE,
        &[
            ("title", &escape(title)),
            ("about", &escape(about)),
            ("tiles", ""),
            ("sections", &sections),
            ("style", STYLE),
            ("script", SCRIPT),
        ],
    )
}

/// A section of the page with its heading; nothing if it has no content.
fn section(id: &str, heading: &str, content: String) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{heading}</h2>\n{content}</section>\n")
}

fn about(report: &Report) -> String {
    let parts = [&report.created, &report.device];
    let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).map(|part| escape(part)).collect();
    parts.join(" &middot; ")
}

fn tiles(tiles: &[SummaryTile]) -> String {
    if tiles.is_empty() {
        return String::new();
    }
    let mut html = String::from("<dl class=\"tiles\">\n");
    for tile in tiles {
        let (label, value, hint) = (escape(&tile.label), escape(&tile.value), escape(&tile.hint));
        let _ = writeln!(html, "<div><dt>{label}</dt><dd>{value}<small>{hint}</small></dd></div>");
    }
    html.push_str("</dl>\n");
    html
}

fn configuration(toml: &str) -> String {
    if toml.is_empty() {
        return String::new();
    }
    let toml = escape(toml);
    format!(
        "<details><summary>config.toml, as resolved</summary>\n<pre tabindex=\"0\"><code>{toml}</code></pre></details>\n"
    )
}

#[cfg(test)]
mod tests;
