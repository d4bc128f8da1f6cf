//! The runs of a study as curves of quality over size.

use serde::Serialize;

use super::curve::{BjontegaardDelta, RatePoint, bjontegaard, convex_hull};
use super::definition::Role;
use super::manifest::Manifest;
use super::measure::Measure;
use super::results::Results;
use super::table::over_seeds;

/// Curves over one or more scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RateCurves {
    /// Name of the scene, or that it is a mean over scenes.
    pub heading: String,
    /// One for each combination of the axes along which curves do not run, then those of values with the role `apart`.
    pub series: Vec<RateSeries>,
    /// Bounds on the quality: label and PSNR, dB.
    pub bounds: Vec<(String, f64)>,
    /// Over all points of all curves, except those with the role `apart`.
    pub hull: Vec<RatePoint>,
}

/// One curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RateSeries {
    /// The values that its runs share.
    pub label: String,
    /// Means over seeds, by ascending size.
    pub points: Vec<RatePoint>,
    /// The points that no mixture of two others surpasses.
    pub hull: Vec<RatePoint>,
    /// Difference of its hull from the first curve's; `None` for the first curve, and where there is no curve.
    pub to_first: Option<BjontegaardDelta>,
}

/// The curves of each scene; with more than one scene, before them the curves of means over all scenes. Empty if the
/// study has no curves.
pub fn rate_curves(manifest: &Manifest, results: &Results) -> Vec<RateCurves> {
    let Some(curves) = &manifest.study.curves else { return Vec::new() };
    let Some(along) = manifest.study.axis.iter().position(|axis| axis.name == curves.along) else { return Vec::new() };
    let all: Vec<usize> = (0..manifest.scenes.len()).collect();
    let mut groups = Vec::new();
    if all.len() > 1 {
        groups.push((format!("mean over {} scenes", all.len()), all));
    }
    groups.extend(manifest.scenes.iter().enumerate().map(|(index, scene)| (scene.name.clone(), vec![index])));
    groups.into_iter().map(|(heading, scenes)| curves_of(manifest, results, along, heading, &scenes)).collect()
}

fn curves_of(manifest: &Manifest, results: &Results, along: usize, heading: String, scenes: &[usize]) -> RateCurves {
    let axes = &manifest.study.axis;
    let mut series: Vec<RateSeries> = Vec::new();
    let mut apart: Vec<RateSeries> = Vec::new();
    let mut bounds = Vec::new();
    for (index, variant) in manifest.variants().iter().enumerate() {
        let mean = |measure| over_seeds(manifest, results, scenes, index, measure).map(|spread| spread.mean);
        let (Some(bytes), Some(psnr)) = (mean(Measure::Bytes), mean(Measure::Psnr)) else { continue };
        let value = &axes[along].value[variant.values[along]];
        let others = axes.iter().zip(&variant.values).enumerate().filter(|(axis, _)| *axis != along);
        let others: Vec<&str> = others.map(|(_, (axis, value))| axis.value[*value].label()).collect();
        let label = if others.is_empty() { manifest.study.title.clone() } else { others.join(", ") };
        match value.role {
            Role::Point => push(&mut series, label, RatePoint { bytes, psnr }),
            Role::Apart => push(&mut apart, value.label().to_owned(), RatePoint { bytes, psnr }),
            Role::Bound => bounds.push((format!("{label}, {}", value.label()), psnr)),
        }
    }
    let points: Vec<RatePoint> = series.iter().flat_map(|series| series.points.clone()).collect();
    series.append(&mut apart);
    for one in &mut series {
        one.points.sort_by(|a, b| a.bytes.total_cmp(&b.bytes));
        one.hull = convex_hull(&one.points);
    }
    if let Some((first, others)) = series.split_first_mut() {
        others.iter_mut().for_each(|other| other.to_first = bjontegaard(&first.hull, &other.hull));
    }
    RateCurves { heading, series, bounds, hull: convex_hull(&points) }
}

fn push(series: &mut Vec<RateSeries>, label: String, point: RatePoint) {
    match series.iter_mut().find(|one| one.label == label) {
        Some(one) => one.points.push(point),
        None => series.push(RateSeries { label, points: vec![point], hull: Vec::new(), to_first: None }),
    }
}

impl RateCurves {
    /// Bjøntegaard's differences in Markdown; empty if there is only one curve.
    pub fn to_markdown(&self) -> String {
        let [first, others @ ..] = &self.series[..] else { return String::new() };
        if others.is_empty() {
            return String::new();
        }
        let mut text = format!(
            "| {}: hull of the curve, to \"{}\" | BD-rate % | BD-PSNR dB |\n| --- | --- | --- |\n",
            self.heading, first.label
        );
        for other in others {
            let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:+.2}"));
            let rate = cell(other.to_first.and_then(|delta| delta.rate_percent));
            let psnr = cell(other.to_first.and_then(|delta| delta.psnr));
            text += &format!("| {} | {rate} | {psnr} |\n", other.label);
        }
        text
    }
}
