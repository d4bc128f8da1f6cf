//! The figures of a study: files in `figures/`, and the sections of `report.html`.

mod images;
mod planes;
mod primitives;
mod report;

use std::fmt::Write as _;

use light4gs_data::RgbImage8;
use light4gs_report::{data_uri, escape};
use light4gs_train::error::TrainError;

pub use report::write_report;

use super::definition::{Cost, Output};
use super::manifest::{Manifest, StudyFolder};
use super::measure::Measure;
use super::plots::{Bar, BarPlot, Drawing, Mark, ScatterPlot, Series, draw};
use super::quality_curves::QualityCurves;
use super::results::{Results, RunResult};
use super::spread::Spread;

/// The seed whose run is shown for a variant, where one image is shown.
const SHOWN_SEED: u64 = 0;

/// One figure of a study.
pub struct Figure {
    /// Its section of the report.
    section: &'static str,
    /// Name of its files.
    name: String,
    /// The caption below it.
    caption: String,
    content: Content,
}

enum Content {
    Drawing(Drawing),
    /// Images with their labels.
    Images(Vec<(String, RgbImage8)>),
}

/// All figures of the study, from the runs that are finished.
///
/// # Errors
/// A run whose files are damaged; a plot that cannot be drawn.
pub fn figures(
    folder: &StudyFolder,
    manifest: &Manifest,
    results: &Results,
    curves: &[QualityCurves],
) -> Result<Vec<Figure>, TrainError> {
    let study = &manifest.study;
    let mut figures = Vec::new();
    if study.shows(Output::Curves) {
        for curves in curves.iter().filter(|curves| !curves.series.is_empty()) {
            let content = Content::Drawing(draw(&curves_plot(&study.title, curves))?);
            let caption =
                "Test PSNR of the decoded file over its size. The dashed line is the convex hull of all curves.";
            let name = format!("curves-{}", file_name(&curves.heading));
            figures.push(Figure { section: "Curves", name, caption: caption.to_owned(), content });
        }
    }
    for (scene, named) in manifest.scenes.iter().enumerate() {
        let runs = shown(manifest, results, scene);
        if runs.is_empty() {
            continue;
        }
        if study.shows(Output::Composition) {
            let content = Content::Drawing(draw(&composition(&named.name, manifest, results, scene))?);
            let name = format!("composition-{}", named.name);
            let caption = mean_of_seeds(manifest);
            figures.push(Figure { section: "Composition", name, caption, content });
        }
        if study.shows(Output::Latency) {
            let content = Content::Drawing(draw(&latency(&named.name, manifest, results, scene))?);
            let caption =
                "Coding is of the whole file, spread over the frames of the scene; rendering is of one frame. ";
            let name = format!("latency-{}", named.name);
            let caption = caption.to_owned() + &mean_of_seeds(manifest);
            figures.push(Figure { section: "Latency", name, caption, content });
        }
        if study.shows(Output::PlaneValues) {
            figures.extend(planes::values(folder, &named.name, &runs)?);
        }
        if study.shows(Output::BitMaps) {
            figures.extend(planes::bit_maps(folder, &named.name, &runs)?);
        }
        if study.shows(Output::Primitives) {
            figures.extend(primitives::figures(folder, manifest, scene, &runs)?);
        }
        figures.extend(images::side_by_side(folder, manifest, scene, &runs)?);
    }
    Ok(figures)
}

/// The runs of a scene that are shown for their variants, with their labels.
fn shown<'a>(manifest: &Manifest, results: &'a Results, scene: usize) -> Vec<(String, &'a RunResult)> {
    let variants = manifest.variants().into_iter().enumerate();
    variants.filter_map(|(index, variant)| Some((variant.label, results.get(scene, index, SHOWN_SEED)?))).collect()
}

/// A heading as the name of a file.
fn file_name(heading: &str) -> String {
    heading.replace(|c: char| c.is_whitespace() || c == '/' || c == '\\', "-")
}

fn curves_plot(title: &str, curves: &QualityCurves) -> ScatterPlot {
    let (unit, x_label) = match curves.over {
        Cost::Bytes => (1e6, "file, MB (10^6 bytes)"),
        Cost::Minutes => (1.0, "training, minutes"),
    };
    let place = |point: &super::curve::CurvePoint| (point.cost / unit, point.psnr);
    let mut series: Vec<Series> = curves
        .series
        .iter()
        .map(|one| Series {
            label: one.label.clone(),
            mark: Mark::LinePoints,
            points: one.points.iter().map(place).collect(),
        })
        .collect();
    if curves.series.len() > 1 {
        let points = curves.hull.iter().map(place).collect();
        series.push(Series { label: "convex hull".to_owned(), mark: Mark::Dashed, points });
    }
    ScatterPlot {
        title: format!("{title}: {}", curves.heading),
        x_label: x_label.to_owned(),
        y_label: "test PSNR, dB".to_owned(),
        logarithmic: true,
        series,
        levels: curves.bounds.clone(),
    }
}

/// A bar for each variant with finished runs: the mean over their seeds.
fn bars(
    manifest: &Manifest,
    results: &Results,
    scene: usize,
    values: impl Fn(&RunResult) -> Vec<f64>,
) -> impl Iterator<Item = Bar> {
    manifest.variants().into_iter().enumerate().filter_map(move |(index, variant)| {
        let of_seeds: Vec<Vec<f64>> = results.of_variant(scene, index).map(&values).collect();
        let mean = |part| Spread::of(&of_seeds.iter().map(|values| values[part]).collect::<Vec<_>>()).mean;
        let values = (0..of_seeds.first()?.len()).map(mean).collect();
        Some(Bar { label: variant.label, values })
    })
}

fn mean_of_seeds(manifest: &Manifest) -> String {
    if manifest.seeds > 1 { "Mean over the seeds.".to_owned() } else { String::new() }
}

fn composition(name: &str, manifest: &Manifest, results: &Results, scene: usize) -> BarPlot {
    let mut parts: Vec<String> = Vec::new();
    for (part, _) in results.runs.iter().filter(|run| run.scene == scene).flat_map(|run| &run.sections) {
        if !parts.contains(part) {
            parts.push(part.clone());
        }
    }
    let bytes = |run: &RunResult| {
        let of_part = |part: &String| run.sections.iter().find(|(name, _)| name == part);
        parts.iter().map(|part| of_part(part).map_or(0.0, |(_, bytes)| *bytes as f64)).collect()
    };
    let bars = bars(manifest, results, scene, bytes).collect();
    BarPlot { title: format!("Sections of the file: {name}"), unit: "bytes".to_owned(), parts, bars }
}

fn latency(name: &str, manifest: &Manifest, results: &Results, scene: usize) -> BarPlot {
    let parts = [Measure::EncodePerFrame, Measure::DecodePerFrame, Measure::RenderMilliseconds];
    let times = |run: &RunResult| parts.iter().map(|part| part.of(run).unwrap_or(0.0)).collect();
    BarPlot {
        title: format!("Time of a frame: {name}"),
        unit: "ms".to_owned(),
        parts: ["encoding", "decoding", "rendering"].map(str::to_owned).into(),
        bars: bars(manifest, results, scene, times).collect(),
    }
}

impl Figure {
    /// Writes its files into the study's `figures/`.
    fn write(&self, folder: &StudyFolder) -> Result<(), TrainError> {
        let save = |name: String, image: &RgbImage8| image.save_png(&folder.path("figures").join(name));
        match &self.content {
            Content::Drawing(Drawing { svg, image }) => {
                folder.write(&format!("figures/{}.svg", self.name), svg.as_bytes())?;
                save(format!("{}.png", self.name), image)?;
            }
            Content::Images(images) => {
                for (index, (_, image)) in images.iter().enumerate() {
                    save(format!("{}-{index}.png", self.name), image)?;
                }
            }
        }
        Ok(())
    }

    fn to_html(&self) -> Result<String, TrainError> {
        let mut html = String::from("<figure class=\"study\">\n");
        match &self.content {
            Content::Drawing(drawing) => html += &drawing.svg,
            Content::Images(images) => {
                html += "<div class=\"maps\">\n";
                for (label, image) in images {
                    let data = data_uri(image).map_err(|error| {
                        TrainError::Input(format!("image {label} of {} cannot be shown: {error}", self.name))
                    })?;
                    let (label, width, height) = (escape(label), image.width, image.height);
                    let class = if width > 3 * height { " class=\"wide\"" } else { "" };
                    let _ = writeln!(
                        html,
                        "<div{class}><img src=\"{data}\" alt=\"{label}\" width=\"{width}\" height=\"{height}\"><span>{label}</span></div>"
                    );
                }
                html += "</div>\n";
            }
        }
        let _ = writeln!(html, "<figcaption>{}</figcaption>\n</figure>", escape(&self.caption));
        Ok(html)
    }
}
