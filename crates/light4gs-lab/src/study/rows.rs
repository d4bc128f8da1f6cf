//! `record.json`: every measure of a study, means and standard deviations over its seeds, with where they come from. A copy of it
//! in `results/` of the repository replaces the figures of the pages.

use serde_json::{Value, json};

use super::manifest::Manifest;
use super::measure::{Column, Form, Measure};
use super::quality_curves::QualityCurves;
use super::results::{Results, Training};
use super::spread::Spread;
use super::table::column_over_seeds;
use crate::record::{Provenance, Record, Row, day};

/// The scene of rows with means over all scenes.
const MEAN: &str = "mean";
/// For what older runs do not say.
const UNKNOWN: &str = "unknown";

/// A row for each scene and variant, before them (with more than one scene) those of the means over the scenes, and after them one for
/// each curve that is compared with the first.
pub fn record(manifest: &Manifest, results: &Results, curves: &[QualityCurves]) -> Record {
    let columns: Vec<Column> = Measure::ALL
        .iter()
        .map(|measure| Column { measure: *measure, form: Form::Value })
        .chain(manifest.study.columns.iter().copied().filter(|column| column.form != Form::Value))
        .collect();
    let names: Vec<&str> = manifest.scenes.iter().map(|scene| scene.name.as_str()).collect();
    let all: Vec<usize> = (0..names.len()).collect();
    let mean = (names.len() > 1).then(|| (MEAN, all.clone()));
    let scopes: Vec<(&str, Vec<usize>)> =
        mean.into_iter().chain(all.into_iter().map(|scene| (names[scene], vec![scene]))).collect();
    let mut rows: Vec<Row> =
        scopes.iter().flat_map(|(name, scenes)| variant_rows(manifest, results, &columns, name, scenes)).collect();
    for ((scene, _), curves) in scopes.iter().zip(curves) {
        rows.extend(curves.series.iter().filter_map(|series| {
            let delta = series.to_first?;
            let row = json!({
                "scene": scene,
                "curve": series.label,
                "bd_cost_percent": delta.cost_percent,
                "bd_psnr": delta.psnr,
            });
            row.as_object().cloned()
        }));
    }
    Record { provenance: provenance(manifest, results), rows }
}

fn variant_rows(manifest: &Manifest, results: &Results, columns: &[Column], scene: &str, scenes: &[usize]) -> Vec<Row> {
    let axes = &manifest.study.axis;
    let of_variant = |(index, variant): (usize, super::plan::Variant)| {
        let mut row = Row::new();
        row.insert("scene".to_owned(), scene.into());
        row.insert("label".to_owned(), variant.label.into());
        for (axis, value) in axes.iter().zip(variant.values) {
            row.insert(axis.name.clone(), axis.value[value].name.clone().into());
        }
        for column in columns {
            if let Some(spread) = column_over_seeds(manifest, results, scenes, index, column) {
                row.insert(column.to_string(), figure(spread));
            }
        }
        row
    };
    manifest.variants().into_iter().enumerate().map(of_variant).collect()
}

/// A number for one seed, mean and standard deviation for more.
fn figure(Spread { mean, deviation, .. }: Spread) -> Value {
    match deviation {
        Some(deviation) => json!({ "mean": mean, "deviation": deviation }),
        None => mean.into(),
    }
}

/// What the runs say of their trainings: all commits and machines, the first and the last day.
fn provenance(manifest: &Manifest, results: &Results) -> Provenance {
    let each = |value: fn(&Training) -> String| {
        let mut values: Vec<String> = results.runs.iter().map(|run| value(&run.trained)).collect();
        values.sort();
        values.dedup();
        values
    };
    let known = |text: String| if text.is_empty() { UNKNOWN.to_owned() } else { text };
    let all = |value| known(each(value).into_iter().map(known).collect::<Vec<_>>().join("; "));
    let days = each(|training| day(&training.begun));
    let date = match (days.first(), days.last()) {
        (Some(first), Some(last)) if first != last => format!("{first} to {last}"),
        (first, _) => known(first.cloned().unwrap_or_default()),
    };
    Provenance {
        command: known(manifest.command.clone()),
        commit: all(|training| training.commit.clone()),
        machine: all(|training| training.machine.clone()),
        date,
        seeds: (0..manifest.seeds).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::quality_curves::quality_curves;
    use super::super::table::tests::example;
    use super::*;

    #[test]
    fn rows_have_names_and_spreads_and_the_record_says_where_they_come_from() {
        let psnr = |scene: usize, variant: usize, seed: u64| Some((20 + scene * 4 + variant * 2) as f64 + seed as f64);
        let (manifest, mut results) = example(&["x", "y"], 2, psnr);
        for (index, run) in results.runs.iter_mut().enumerate() {
            let begun = format!("2026-11-2{} 08:00:00 UTC", index.min(1) + 3);
            run.trained = Training { commit: "abc".into(), machine: "a processor, 2 cores".into(), begun };
        }
        let record = record(&manifest, &results, &quality_curves(&manifest, &results));
        let row = |scene: &str, variant: &str| {
            record.rows.iter().find(|row| row["scene"] == scene && row.get("a") == Some(&variant.into())).unwrap()
        };
        assert_eq!(row("mean", "one")["psnr"]["mean"], 22.5);
        assert!((row("y", "two")["psnr"]["deviation"].as_f64().unwrap() - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(row("x", "two")["psnr:difference"], json!({ "mean": 2.0, "deviation": 0.0 }));
        assert!(!row("x", "one").contains_key("psnr:difference") && row("x", "two").contains_key("psnr:percent"));
        let Provenance { command, commit, machine, date, seeds } = record.provenance;
        assert_eq!((command.as_str(), commit.as_str()), ("light4gs study example", "abc"));
        assert_eq!((machine.as_str(), date.as_str()), ("a processor, 2 cores", "2026-11-23 to 2026-11-24"));
        assert_eq!(seeds, [0, 1]);
    }

    #[test]
    fn what_is_not_known_is_called_so() {
        let (mut manifest, results) = example(&["x"], 1, |_, _, _| Some(30.0));
        manifest.command.clear();
        let record = record(&manifest, &results, &[]);
        assert_eq!(record.rows[0]["psnr"], 30.0);
        let Provenance { command, commit, machine, date, .. } = record.provenance;
        assert_eq!([command, commit, machine, date], [UNKNOWN; 4]);
    }
}
