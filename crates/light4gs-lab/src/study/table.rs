//! A study's tables: a row for each variant, means and standard deviations over seeds, differences to the reference.

use std::collections::BTreeSet;

use light4gs_train::table::{Align, Table};
use serde::Serialize;

use super::definition::Published;
use super::manifest::Manifest;
use super::measure::{Column, Form, Measure};
use super::quality_curves::QualityCurves;
use super::results::Results;
use super::spread::Spread;

/// Marks a difference that is no larger than its standard deviation over seeds.
pub const WITHIN_SPREAD: &str = "≈";

/// The text of a cell without a figure.
const ABSENT: &str = "–";

/// One table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyTable {
    /// Name of the scene, or that it is a mean over scenes.
    pub heading: String,
    /// Headings of the columns after the first.
    pub columns: Vec<String>,
    /// One for each variant.
    pub rows: Vec<StudyRow>,
    /// Published figures on the same data.
    pub published: Vec<PublishedRow>,
}

/// A row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyRow {
    /// The variant.
    pub label: String,
    /// Its finished runs, and its planned runs.
    pub runs: [usize; 2],
    /// One for each column; `None` where nothing was measured.
    pub cells: Vec<Option<Cell>>,
}

/// A cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Mean over seeds, or the difference of such means.
    pub value: f64,
    /// Sample standard deviation over seeds, in the unit of the cell; `None` for one seed.
    pub deviation: Option<f64>,
    /// For differences, whether the standard deviation over seeds is as large. `None` if there is none, or for other
    /// cells.
    pub within_spread: Option<bool>,
    /// The text that is shown.
    pub text: String,
}

/// A published result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PublishedRow {
    /// For the first column.
    pub label: String,
    /// Width and height of the images.
    pub resolution: [u32; 2],
    /// Color behind the scene.
    pub background: [f32; 3],
    /// Test PSNR, dB.
    pub psnr: f64,
    /// Test SSIM.
    pub ssim: Option<f64>,
    /// Size, bytes.
    pub bytes: Option<f64>,
    /// Its source.
    pub source: String,
}

/// A table for each scene; with more than one scene, before them a table of means over all scenes.
pub fn tables(manifest: &Manifest, results: &Results) -> Vec<StudyTable> {
    let all: Vec<usize> = (0..manifest.scenes.len()).collect();
    let mut tables = Vec::new();
    if all.len() > 1 {
        tables.push(table(manifest, results, &format!("mean over {} scenes", all.len()), &all));
    }
    for (scene, named) in manifest.scenes.iter().enumerate() {
        tables.push(table(manifest, results, &named.name, &[scene]));
    }
    tables
}

fn table(manifest: &Manifest, results: &Results, heading: &str, scenes: &[usize]) -> StudyTable {
    let study = &manifest.study;
    let variants = manifest.variants();
    let reference = reference(manifest);
    let of = |variant: usize, measure: Measure| by_seed(manifest, results, scenes, variant, measure);
    // Most datasets have no masks, and most machines no weights of LPIPS.
    let is_measured =
        |measure: Measure| (0..variants.len()).any(|index| of(index, measure).iter().any(Option::is_some));
    let shown = |column: &&Column| !column.measure.may_be_absent() || is_measured(column.measure);
    let columns: Vec<&Column> = study.columns.iter().filter(shown).collect();
    let rows = variants.iter().enumerate().map(|(index, variant)| StudyRow {
        label: variant.label.clone(),
        runs: [
            results.runs.iter().filter(|run| run.variant == index && scenes.contains(&run.scene)).count(),
            manifest.runs.iter().filter(|run| run.variant == index && scenes.contains(&run.scene)).count(),
        ],
        cells: columns
            .iter()
            .map(|column| {
                let own = of(index, column.measure);
                match column.form {
                    Form::Value => value_cell(&own, column),
                    _ if index == reference => None,
                    _ => difference_cell(&own, &of(reference, column.measure), column),
                }
            })
            .collect(),
    });
    StudyTable {
        heading: heading.to_owned(),
        columns: columns.iter().map(|column| column.heading()).collect(),
        rows: rows.collect(),
        published: published(manifest, results, scenes),
    }
}

/// Index of the variant to which differences are.
fn reference(manifest: &Manifest) -> usize {
    let named = manifest.study.reference.as_ref();
    named.and_then(|name| manifest.variants().iter().position(|variant| variant.name == *name)).unwrap_or(0)
}

/// The values of a measure by seed, each the mean over the scenes; `None` for seeds that lack a scene.
fn by_seed(
    manifest: &Manifest,
    results: &Results,
    scenes: &[usize],
    variant: usize,
    measure: Measure,
) -> Vec<Option<f64>> {
    let of_seed = |seed: u64| -> Option<f64> {
        let values = scenes.iter().map(|scene| measure.of(results.get(*scene, variant, seed)?));
        let values = values.collect::<Option<Vec<_>>>()?;
        Some(values.iter().sum::<f64>() / values.len() as f64)
    };
    (0..manifest.seeds).map(of_seed).collect()
}

/// Mean and standard deviation of a measure over the seeds that have all scenes.
pub(super) fn over_seeds(
    manifest: &Manifest,
    results: &Results,
    scenes: &[usize],
    variant: usize,
    measure: Measure,
) -> Option<Spread> {
    spread_of(by_seed(manifest, results, scenes, variant, measure).into_iter())
}

/// A column of a variant over the seeds that have all scenes; no difference of the reference to itself.
pub(super) fn column_over_seeds(
    manifest: &Manifest,
    results: &Results,
    scenes: &[usize],
    variant: usize,
    column: &Column,
) -> Option<Spread> {
    let of = |variant| by_seed(manifest, results, scenes, variant, column.measure);
    let reference = reference(manifest);
    match column.form {
        Form::Value => spread_of(of(variant).into_iter()),
        _ if variant == reference => None,
        form => differences(&of(variant), &of(reference), form),
    }
}

fn spread_of(values: impl Iterator<Item = Option<f64>>) -> Option<Spread> {
    let values: Vec<f64> = values.flatten().collect();
    (!values.is_empty()).then(|| Spread::of(&values))
}

fn value_cell(by_seed: &[Option<f64>], column: &Column) -> Option<Cell> {
    let spread = spread_of(by_seed.iter().copied())?;
    let text = spread.to_text(column.measure.digits());
    Some(Cell { value: spread.mean, deviation: spread.deviation, within_spread: None, text })
}

/// Runs of the same seed begin alike and see the same frames in the same order, so they are compared with each other.
fn differences(own: &[Option<f64>], reference: &[Option<f64>], form: Form) -> Option<Spread> {
    let differences = own.iter().zip(reference).map(|(own, reference)| {
        let (own, reference) = ((*own)?, (*reference)?);
        match form {
            Form::Percent => (reference != 0.0).then(|| 100.0 * (own / reference - 1.0)),
            _ => Some(own - reference),
        }
    });
    spread_of(differences)
}

fn difference_cell(own: &[Option<f64>], reference: &[Option<f64>], column: &Column) -> Option<Cell> {
    let percent = column.form == Form::Percent;
    let digits = if percent { 1.max(column.measure.digits()) } else { column.measure.digits() };
    let spread = differences(own, reference, column.form)?;
    let within_spread = spread.is_within_deviation();
    let mark = if within_spread == Some(true) { format!(" {WITHIN_SPREAD}") } else { String::new() };
    // Zero has no sign.
    let value = spread.mean;
    let shown = if value.abs() < 0.5 * 10f64.powi(-(digits as i32)) { 0.0 } else { value };
    let text = match spread.deviation {
        Some(deviation) => format!("{shown:+.digits$} ± {deviation:.digits$}{mark}"),
        None => format!("{shown:+.digits$}"),
    };
    Some(Cell { value, deviation: spread.deviation, within_spread, text })
}

/// Published figures for the scenes of the table, and for the image size and background of at least one of its runs. Where
/// only figures of single scenes are known, and of all scenes of the table, the table has their means.
fn published(manifest: &Manifest, results: &Results, scenes: &[usize]) -> Vec<PublishedRow> {
    let names: BTreeSet<&str> = scenes.iter().map(|scene| manifest.scenes[*scene].name.as_str()).collect();
    let runs = || results.runs.iter().filter(|run| scenes.contains(&run.scene));
    let all = &manifest.study.published;
    let same_scenes = |row: &&Published| row.scenes.iter().map(String::as_str).collect::<BTreeSet<_>>() == names;
    let whole = all.iter().filter(same_scenes).map(|row| vec![row]);
    let parts = all.iter().enumerate().filter(|_| names.len() > 1).filter_map(|(index, first)| {
        let like = |row: &&Published| row.scenes.len() == 1 && row.has_conditions_of(first);
        if first.scenes.len() != 1 || all[..index].iter().any(|row| like(&row)) {
            return None;
        }
        let rows: Vec<_> = all.iter().filter(like).filter(|row| names.contains(row.scenes[0].as_str())).collect();
        (rows.len() == names.len()).then_some(rows)
    });
    let comparable = |rows: &Vec<&Published>| {
        runs().any(|run| run.resolution == rows[0].resolution && run.background == rows[0].background)
    };
    whole.chain(parts).filter(comparable).map(|rows| mean_row(&rows)).collect()
}

/// The mean of published rows; of one row, itself.
fn mean_row(rows: &[&Published]) -> PublishedRow {
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let mean_of =
        |value: fn(&Published) -> Option<f64>| rows.iter().map(|row| value(row)).collect::<Option<Vec<_>>>().map(mean);
    let first = rows[0];
    PublishedRow {
        label: first.name.clone(),
        resolution: first.resolution,
        background: first.background,
        psnr: mean(rows.iter().map(|row| row.psnr).collect()),
        ssim: mean_of(|row| row.ssim),
        bytes: mean_of(|row| row.bytes),
        source: first.source.clone(),
    }
}

/// Name of a color behind the scene.
fn background_name(color: [f32; 3]) -> String {
    match color {
        [1.0, 1.0, 1.0] => "white".to_owned(),
        [0.0, 0.0, 0.0] => "black".to_owned(),
        [red, green, blue] => format!("({red}, {green}, {blue})"),
    }
}

impl StudyTable {
    /// Every cell as text, with the labels first. Rows that lack runs say so.
    pub fn lines(&self) -> Vec<Vec<String>> {
        let ours = self.rows.iter().map(|row| {
            let [done, planned] = row.runs;
            let label =
                if done == planned { row.label.clone() } else { format!("{} ({done} of {planned} runs)", row.label) };
            let cells =
                row.cells.iter().map(|cell| cell.as_ref().map_or_else(|| ABSENT.to_owned(), |c| c.text.clone()));
            std::iter::once(label).chain(cells).collect()
        });
        let optional =
            |value: Option<f64>, digits| value.map_or_else(|| ABSENT.to_owned(), |v| format!("{v:.digits$}"));
        let published = self.published.iter().map(|row| {
            let cell = |heading: &String| match heading {
                heading if heading == Measure::Psnr.heading() => format!("{:.2}", row.psnr),
                heading if heading == Measure::Ssim.heading() => optional(row.ssim, Measure::Ssim.digits()),
                heading if heading == Measure::Bytes.heading() => optional(row.bytes, Measure::Bytes.digits()),
                _ => ABSENT.to_owned(),
            };
            let [width, height] = row.resolution;
            let background = background_name(row.background);
            let label = format!("published: {} ({}; {width}×{height} on {background})", row.label, row.source);
            std::iter::once(label).chain(self.columns.iter().map(cell)).collect()
        });
        ours.chain(published).collect()
    }

    /// For a terminal.
    pub fn to_text(&self) -> Table {
        let columns = self.columns.iter().map(|name| (name.clone(), Align::Right));
        let mut table = Table::new(std::iter::once((self.heading.clone(), Align::Left)).chain(columns));
        for line in self.lines() {
            table.row(line);
        }
        table
    }

    /// For `docs/`.
    pub fn to_markdown(&self) -> String {
        let cell = |text: &String| text.replace('|', "\\|");
        let row = |cells: &mut dyn Iterator<Item = String>| format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "));
        let mut text = row(&mut std::iter::once(&self.heading).chain(&self.columns).map(cell));
        text += &row(&mut (0..=self.columns.len()).map(|_| "---".to_owned()));
        for line in self.lines() {
            text += &row(&mut line.iter().map(cell));
        }
        text
    }
}

/// `table.md`: all tables, the meaning of the marks, and the missing runs.
pub fn to_markdown(manifest: &Manifest, results: &Results, tables: &[StudyTable], curves: &[QualityCurves]) -> String {
    let study = &manifest.study;
    let mut text = format!("# {}\n\nReproduces: {}.\n", study.title, study.reproduces);
    if !study.notes.is_empty() {
        text += &format!("\n{}\n", study.notes.trim());
    }
    for table in tables {
        text += &format!("\n{}", table.to_markdown());
    }
    for curves in curves.iter().map(QualityCurves::to_markdown).filter(|text| !text.is_empty()) {
        text += &format!("\n{curves}");
    }
    text += &format!("\n{}\n", legend(manifest));
    if !results.missing.is_empty() {
        text += &format!("\nMissing: {} of {} runs.\n\n", results.missing.len(), manifest.runs.len());
        for missing in &results.missing {
            text += &format!("- {}: {}\n", missing.run, missing.state);
        }
    }
    text
}

/// The meaning of the figures.
pub fn legend(manifest: &Manifest) -> String {
    let variants = manifest.variants();
    let reference = manifest.study.reference.clone().unwrap_or_else(|| variants[0].name.clone());
    let seeds = match manifest.seeds {
        1 => "One run each: how far runs that differ in their seed alone lie apart is not known.".to_owned(),
        seeds => format!(
            "Means of {seeds} seeds ± their standard deviation. {WITHIN_SPREAD} marks a difference that is no larger \
             than that."
        ),
    };
    let has_differences = manifest.study.columns.iter().any(|column| column.form != Form::Value);
    let differences = if has_differences {
        format!("Differences (Δ) are to \"{reference}\" of the same seed. ")
    } else {
        String::new()
    };
    format!("{differences}{seeds} Quality and size are those of the decoded file.")
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::manifest::{ManifestRun, ManifestScene};
    use super::super::quality_curves::quality_curves;
    use super::super::results::{MissingRun, Quality, RunResult, Training};
    use super::super::{Manifest, Study};
    use super::*;

    /// Two variants on some scenes, with PSNR `psnr(scene, variant, seed)`; `None` for a run that is missing.
    pub(in crate::study) fn example(
        scenes: &[&str],
        seeds: u64,
        psnr: impl Fn(usize, usize, u64) -> Option<f64>,
    ) -> (Manifest, Results) {
        let text = r#"
title = "Example"
reproduces = "nothing"
outputs = ["table", "curves"]
columns = ["psnr", "psnr:difference", "psnr:percent", "bytes"]
[[axis]]
name = "a"
value = [{ name = "one" }, { name = "two" }]
[curves]
along = "a"
[[published]]
name = "theirs"
source = "a paper"
scenes = ["x"]
resolution = [4, 4]
psnr = 33.0
bytes = 2.2e6
"#;
        let study = Study::from_toml(text, "example").unwrap();
        let scenes: Vec<_> =
            scenes.iter().map(|name| ManifestScene { name: (*name).to_owned(), path: "/".into() }).collect();
        let mut manifest = Manifest {
            version: String::new(),
            command: "light4gs study example".to_owned(),
            study,
            scenes,
            seeds,
            runs: Vec::new(),
            reuse: Vec::new(),
        };
        let mut results = Results { runs: Vec::new(), missing: Vec::new() };
        for scene in 0..manifest.scenes.len() {
            for seed in 0..seeds {
                for (variant, name) in ["one", "two"].into_iter().enumerate() {
                    let run = format!("{}/{name}/seed-{seed}", manifest.scenes[scene].name);
                    let task = manifest.runs.len();
                    let configuration = String::new();
                    let (name, training) = (run.clone(), None);
                    manifest.runs.push(ManifestRun { name, scene, variant, seed, task, configuration, training });
                    match psnr(scene, variant, seed) {
                        Some(psnr) => results.runs.push(result(run, scene, variant, seed, psnr)),
                        None => results.missing.push(MissingRun {
                            run,
                            task,
                            state: "not begun".into(),
                            share: 0.0,
                            seconds: 0.0,
                        }),
                    }
                }
            }
        }
        (manifest, results)
    }

    fn result(run: String, scene: usize, variant: usize, seed: u64, psnr: f64) -> RunResult {
        RunResult {
            run,
            scene,
            variant,
            seed,
            configuration: String::new(),
            quality: Quality { psnr: Some(psnr), ..Quality::default() },
            val_psnr: None,
            bytes: 1000 * (variant as u64 + 1),
            sections: Vec::new(),
            gaussians: 1,
            resolution: [4, 4],
            background: [1.0; 3],
            frames: None,
            steps: Vec::new(),
            training_seconds: None,
            fit_seconds: None,
            encode_seconds: None,
            decode_seconds: 0.0,
            fps: 1.0,
            device: String::new(),
            trained: Training::default(),
        }
    }

    fn texts(table: &StudyTable, row: usize) -> Vec<String> {
        table.lines()[row].clone()
    }

    #[test]
    fn one_seed_has_no_spread() {
        let (manifest, results) = example(&["x"], 1, |_, variant, _| Some(20.0 + variant as f64));
        let tables = tables(&manifest, &results);
        assert_eq!(tables.len(), 1);
        assert_eq!(texts(&tables[0], 0), ["one", "20.00", "–", "–", "1000"]);
        assert_eq!(texts(&tables[0], 1), ["two", "21.00", "+1.00", "+5.00", "2000"]);
        // Published figures of the same scene, of the same size.
        assert_eq!(texts(&tables[0], 2), ["published: theirs (a paper; 4×4 on white)", "33.00", "–", "–", "2200000"]);
        let curves = quality_curves(&manifest, &results);
        assert_eq!(curves[0].series.len(), 1);
        assert_eq!(curves[0].hull.len(), 2);
        let text = to_markdown(&manifest, &results, &tables, &curves);
        assert!(text.contains("One run each") && !text.contains("Missing"), "{text}");
    }

    #[test]
    fn published_figures_of_single_scenes_have_a_mean() {
        let (mut manifest, results) = example(&["x", "y"], 1, |_, _, _| Some(20.0));
        let theirs = manifest.study.published[0].clone();
        let other = Published { scenes: vec!["y".into()], psnr: 35.0, bytes: None, ..theirs.clone() };
        manifest.study.published.push(other);
        let black = Published { name: "on black".into(), background: [0.0; 3], ..theirs };
        manifest.study.published.push(black);
        let tables = tables(&manifest, &results);
        let [mean, x, y] = &tables[..] else { panic!("three tables") };
        // A size is not known of all scenes, and no run is on black.
        assert_eq!(texts(mean, 2)[1..], ["34.00", "–", "–", "–"]);
        assert_eq!([mean, x, y].map(|table| table.published.len()), [1, 1, 1]);
        assert_eq!((x.published[0].psnr, y.published[0].psnr), (33.0, 35.0));
    }

    #[test]
    fn differences_are_between_runs_of_one_seed() {
        // Seeds differ much, the two variants of a seed do not.
        let (manifest, results) =
            example(&["y"], 3, |_, variant, seed| Some(20.0 + 0.1 * variant as f64 + 20.0 * seed as f64));
        let table = &tables(&manifest, &results)[0];
        assert_eq!(texts(table, 1)[1..4], ["40.10 ± 20.00", "+0.10 ± 0.00", "+0.31 ± 0.17"]);
        assert_eq!(table.rows[1].cells[1].as_ref().unwrap().within_spread, Some(false));
        assert!(table.published.is_empty(), "another scene");
        // One seed differs in one direction, one in the other.
        let (manifest, results) = example(&["y"], 2, |_, variant, seed| Some(20.0 + (variant as u64 * seed) as f64));
        assert_eq!(texts(&tables(&manifest, &results)[0], 1)[2], "+0.50 ± 0.71 ≈");
        // Only the seeds that both variants have.
        let psnr = |_: usize, variant: usize, seed: u64| (seed < 3 - variant as u64).then_some(20.0 + seed as f64);
        let (manifest, results) = example(&["y"], 3, psnr);
        assert_eq!(texts(&tables(&manifest, &results)[0], 1)[2], "+0.00 ± 0.00 ≈");
    }

    #[test]
    fn means_over_scenes_are_by_seed() {
        // The scenes differ much, the seeds do not: the standard deviation is that of the seeds.
        let (manifest, results) = example(&["x", "y"], 2, |scene, _, seed| Some(10.0 * scene as f64 + seed as f64));
        let tables = tables(&manifest, &results);
        assert_eq!(tables.len(), 3);
        let cell = tables[0].rows[0].cells[0].as_ref().unwrap();
        assert_eq!((cell.value, cell.deviation), (5.5, Some(0.5f64.sqrt())));
        assert_eq!(texts(&tables[0], 1)[2], "+0.00 ± 0.00 ≈");
    }

    #[test]
    fn columns_of_regions_show_where_there_are_masks() {
        let (mut manifest, mut results) = example(&["x", "y"], 1, |_, _, _| Some(20.0));
        let column = |text: &str| serde_json::from_value(text.into()).unwrap();
        manifest.study.columns = ["psnr", "moving_psnr", "moving_psnr:difference", "still_ssim"].map(column).into();
        assert!(tables(&manifest, &results).iter().all(|table| table.columns == ["PSNR dB"]));
        for run in results.runs.iter_mut().filter(|run| run.scene == 1) {
            run.quality.moving_psnr = Some(15.0 + run.variant as f64);
        }
        // The scenes have no common mean of what only one of them has.
        let [mean, x, y] = &tables(&manifest, &results)[..] else { panic!("three tables") };
        assert_eq!((&mean.columns[..], &x.columns[..]), (&["PSNR dB".to_owned()][..], &["PSNR dB".to_owned()][..]));
        assert_eq!(y.columns, ["PSNR dB", "moving dB", "Δmoving dB"]);
        assert_eq!(texts(y, 1), ["two", "20.00", "16.00", "+1.00"]);
    }

    #[test]
    fn missing_runs_are_said() {
        let (manifest, results) =
            example(&["x", "y"], 2, |scene, variant, seed| (scene == 0 && (variant, seed) != (1, 0)).then_some(20.0));
        let tables = tables(&manifest, &results);
        // No seed has both scenes: there is no mean over scenes.
        assert_eq!(texts(&tables[0], 0), ["one (2 of 4 runs)", "–", "–", "–", "–"]);
        assert_eq!(texts(&tables[1], 1)[..2], ["two (1 of 2 runs)", "20.00"]);
        let text = to_markdown(&manifest, &results, &tables, &[]);
        assert!(text.contains("Missing: 5 of 8 runs.") && text.contains("- y/one/seed-0: not begun"), "{text}");
        let (manifest, results) = example(&["x"], 1, |_, _, _| None);
        assert_eq!(texts(&super::tables(&manifest, &results)[0], 0)[1], "–");
        assert!(quality_curves(&manifest, &results)[0].hull.is_empty());
        assert_eq!(results.to_csv(&manifest, false).lines().count(), 1);
    }
}
