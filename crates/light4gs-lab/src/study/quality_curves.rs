//! The runs of a study as curves of quality over bytes or minutes.

use serde::Serialize;

use super::curve::{BjontegaardDelta, CurvePoint, bjontegaard, convex_hull};
use super::definition::{Cost, Role};
use super::manifest::Manifest;
use super::measure::Measure;
use super::results::Results;
use super::table::over_seeds;

/// Curves over one or more scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QualityCurves {
    /// The cost of a point.
    pub over: Cost,
    /// Name of the scene, or that it is a mean over scenes.
    pub heading: String,
    /// One for each combination of the axes along which curves do not run, then those of values with the role `apart`.
    pub series: Vec<CurveSeries>,
    /// Bounds on the quality: label and PSNR, dB.
    pub bounds: Vec<(String, f64)>,
    /// Over all points of all curves, except those with the role `apart`.
    pub hull: Vec<CurvePoint>,
}

/// One curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CurveSeries {
    /// The values that its runs share.
    pub label: String,
    /// Means over seeds, by ascending cost.
    pub points: Vec<CurvePoint>,
    /// The points that no mixture of two others surpasses.
    pub hull: Vec<CurvePoint>,
    /// Difference of its hull from the first curve's; `None` for the first curve, and where there is no curve.
    pub to_first: Option<BjontegaardDelta>,
}

/// The curves of each scene; with more than one scene, before them the curves of means over all scenes. Empty if the
/// study has no curves.
pub fn quality_curves(manifest: &Manifest, results: &Results) -> Vec<QualityCurves> {
    let Some(curves) = &manifest.study.curves else { return Vec::new() };
    let Some(along) = manifest.study.axis.iter().position(|axis| axis.name == curves.along) else { return Vec::new() };
    let of =
        |(heading, scenes): (String, Vec<usize>)| curves_of(manifest, results, (curves.over, along), heading, &scenes);
    let all: Vec<usize> = (0..manifest.scenes.len()).collect();
    let mut groups = Vec::new();
    if all.len() > 1 {
        groups.push((format!("mean over {} scenes", all.len()), all));
    }
    groups.extend(manifest.scenes.iter().enumerate().map(|(index, scene)| (scene.name.clone(), vec![index])));
    groups.into_iter().map(of).collect()
}

/// Over a cost, along an axis.
fn curves_of(
    manifest: &Manifest,
    results: &Results,
    (over, along): (Cost, usize),
    heading: String,
    scenes: &[usize],
) -> QualityCurves {
    let axes = &manifest.study.axis;
    let mut series: Vec<CurveSeries> = Vec::new();
    let mut apart: Vec<CurveSeries> = Vec::new();
    let mut bounds = Vec::new();
    for (index, variant) in manifest.variants().iter().enumerate() {
        let mean = |measure| over_seeds(manifest, results, scenes, index, measure).map(|spread| spread.mean);
        let (Some(cost), Some(psnr)) = (mean(over.measure()), mean(Measure::Psnr)) else { continue };
        let value = &axes[along].value[variant.values[along]];
        let others = axes.iter().zip(&variant.values).enumerate().filter(|(axis, _)| *axis != along);
        let others: Vec<&str> = others.map(|(_, (axis, value))| axis.value[*value].label()).collect();
        let label = if others.is_empty() { manifest.study.title.clone() } else { others.join(", ") };
        match value.role {
            Role::Point => push(&mut series, label, CurvePoint { cost, psnr }),
            Role::Apart => push(&mut apart, value.label().to_owned(), CurvePoint { cost, psnr }),
            Role::Bound => bounds.push((format!("{label}, {}", value.label()), psnr)),
        }
    }
    let points: Vec<CurvePoint> = series.iter().flat_map(|series| series.points.clone()).collect();
    series.append(&mut apart);
    for one in &mut series {
        one.points.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        one.hull = convex_hull(&one.points);
    }
    if let Some((first, others)) = series.split_first_mut() {
        others.iter_mut().for_each(|other| other.to_first = bjontegaard(&first.hull, &other.hull));
    }
    QualityCurves { over, heading, series, bounds, hull: convex_hull(&points) }
}

fn push(series: &mut Vec<CurveSeries>, label: String, point: CurvePoint) {
    match series.iter_mut().find(|one| one.label == label) {
        Some(one) => one.points.push(point),
        None => series.push(CurveSeries { label, points: vec![point], hull: Vec::new(), to_first: None }),
    }
}

impl QualityCurves {
    /// Bjøntegaard's differences: headings, and a row for each curve but the first. `None` if there is only one curve.
    pub fn differences(&self) -> Option<(Vec<String>, Vec<Vec<String>>)> {
        let [first, others @ ..] = &self.series[..] else { return None };
        let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:+.2}"));
        let row = |other: &CurveSeries| {
            let delta = |pick: fn(BjontegaardDelta) -> Option<f64>| cell(other.to_first.and_then(pick));
            vec![other.label.clone(), delta(|delta| delta.cost_percent), delta(|delta| delta.psnr)]
        };
        let heading = format!("{}: hull of the curve, to \"{}\"", self.heading, first.label);
        let headings = vec![heading, format!("{} %", self.over.difference()), "BD-PSNR dB".to_owned()];
        (!others.is_empty()).then(|| (headings, others.iter().map(row).collect()))
    }

    /// These differences in Markdown; empty if there is only one curve.
    pub fn to_markdown(&self) -> String {
        let Some((headings, rows)) = self.differences() else { return String::new() };
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = headings.iter().map(|_| "---".to_owned()).collect();
        [headings, rule].iter().chain(&rows).map(|cells| line(cells)).collect()
    }
}
