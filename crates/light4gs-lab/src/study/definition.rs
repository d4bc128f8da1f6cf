//! A study as TOML.
//!
//! ```
//! let text = r#"
//! title = "Weights of the rate"
//! reproduces = "nothing: a question of one's own"
//! reference = "weak"
//! outputs = ["table"]
//!
//! [[axis]]
//! name = "lambda"
//! value = [
//!     { name = "weak", set = ["compression.rate.lambda=0.002"] },
//!     { name = "strong", set = ["compression.rate.lambda=0.02"] },
//! ]
//! "#;
//! let study = light4gs_lab::study::Study::from_toml(text, "mine.toml")?;
//! assert_eq!(study.axis[0].value.len(), 2);
//! # Ok::<(), light4gs_train::error::TrainError>(())
//! ```

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::Path;

use light4gs_data::read_regular_text;
use light4gs_keys::choice;
use light4gs_train::config::{MAX_CONFIG_BYTES, UnknownChoice};
use light4gs_train::error::TrainError;
use serde::{Deserialize, Serialize};

use super::catalog;
use super::measure::{Column, Measure, default_columns};

/// A study with more runs is taken for a mistake.
const MOST_VARIANTS: usize = 10_000;

/// The preset that variants start from, where neither the command nor a value names one.
pub const DEFAULT_CONFIG: &str = "hexplane-dnerf-cpu";

/// Legal factors of the length of a schedule.
pub const SCHEDULES: RangeInclusive<f64> = 0.001..=1000.0;

/// Says that a factor is not in [`SCHEDULES`], if so; to be put behind its name.
pub(super) fn schedule_problem(factor: f64) -> Option<String> {
    let (least, most) = SCHEDULES.into_inner();
    let problem = || format!("is {factor}; it is how many times as long the schedule is, {least} to {most}");
    (!SCHEDULES.contains(&factor)).then(problem)
}

/// The definition of a study: the axes that vary, and the outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Heading of the report.
    pub title: String,
    /// The table or figure of the paper that it reproduces.
    pub reproduces: String,
    /// How it differs from that, and what to look for; may be empty.
    #[serde(default)]
    pub notes: String,
    /// The preset or file that variants start from, where neither a value nor the command names one; [`DEFAULT_CONFIG`] if
    /// not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<String>,
    /// Presets that are laid on top of the base configuration in every run, before those of the axes.
    #[serde(default)]
    pub presets: Vec<String>,
    /// The variant with which others are compared; by default the first one.
    #[serde(default)]
    pub reference: Option<String>,
    /// The outputs that are made from the runs.
    pub outputs: Vec<Output>,
    /// Columns of the table.
    #[serde(default = "default_columns")]
    pub columns: Vec<Column>,
    /// The axis of the curves; needed for [`Output::Curves`].
    #[serde(default)]
    pub curves: Option<Curves>,
    /// The axes that vary. Variants are all combinations of their values; the last axis varies fastest.
    pub axis: Vec<Axis>,
    /// Published figures for the same data.
    #[serde(default)]
    pub published: Vec<Published>,
}

choice! {
    /// An output that is made from a study's runs.
    pub enum Output: "output" {
        /// Means, spreads, differences to the reference.
        Table = "table",
        /// Quality over file size, with convex hulls and Bjøntegaard's differences.
        Curves = "curves",
        /// Shares of the file's sections.
        Composition = "composition",
        /// Maps of the planes' bits.
        BitMaps = "bit_maps",
        /// Histograms of the decoded planes' values.
        PlaneValues = "plane_values",
        /// Time of coding and rendering for each frame.
        Latency = "latency",
        /// First and last frame, and the primitives that draw them.
        Primitives = "primitives",
    }
}

/// Something that varies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// For tables and plots.
    pub name: String,
    /// Its values, in the order of the rows.
    pub value: Vec<AxisValue>,
}

/// One value of an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisValue {
    /// Letters, digits, `.` and `-`: a part of the run's folder.
    pub name: String,
    /// For tables and plots; the name if not given.
    #[serde(default)]
    pub label: Option<String>,
    /// The preset or file that variants with this value start from, whatever the command names: it is what the value is
    /// about. A preset that extends another one can stand only here or at [`Study::config`].
    #[serde(default)]
    pub config: Option<String>,
    /// Presets or files, which are laid on top in this order.
    #[serde(default)]
    pub presets: Vec<String>,
    /// Length of the schedule, divided by that of the presets; see [`SCHEDULES`].
    #[serde(default)]
    pub schedule: Option<f64>,
    /// Overrides, as for `--set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// Name of a training that the program has in addition, with parts of its own; see `light4gs::cli::Program`.
    #[serde(default)]
    pub training: Option<String>,
    /// Its role in curves.
    #[serde(default)]
    pub role: Role,
}

choice! {
    /// The role in curves of a value of the axis along which they run.
    #[derive(Default)]
    pub enum Role: "role" {
        /// A point of the curve of the other axes' values.
        #[default]
        Point = "point",
        /// A bound on the quality: a line across the plot.
        Bound = "bound",
        /// A point of a separate curve, which runs along the other axes.
        Apart = "apart",
    }
}

/// How curves are made from runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// Name of the axis whose values are the points of a curve. Each combination of the other axes' values is a curve.
    pub along: String,
    /// The cost of a point.
    #[serde(default)]
    pub over: Cost,
}

choice! {
    /// The cost of a point of a curve.
    #[derive(Default)]
    pub enum Cost: "cost" {
        /// Bytes of the file.
        #[default]
        Bytes = "bytes",
        /// Minutes of training: those of this machine and its load.
        Minutes = "minutes",
    }
}

impl Cost {
    /// How it is measured.
    pub fn measure(self) -> Measure {
        match self {
            Self::Bytes => Measure::Bytes,
            Self::Minutes => Measure::Minutes,
        }
    }

    /// Name of the difference at equal quality.
    pub fn difference(self) -> &'static str {
        match self {
            Self::Bytes => "BD-rate",
            Self::Minutes => "BD-minutes",
        }
    }
}

/// Published results on known data. They are shown where a run of the study has the same scenes, image size and background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// For tables and plots.
    pub name: String,
    /// The source of the figures.
    pub source: String,
    /// Names of the scenes over which they are means.
    pub scenes: Vec<String>,
    /// Width and height of the images.
    pub resolution: [u32; 2],
    /// Color behind the scene, 0 to 1; white if not given.
    #[serde(default = "white")]
    pub background: [f32; 3],
    /// Test PSNR, dB.
    pub psnr: f64,
    /// Test SSIM.
    #[serde(default)]
    pub ssim: Option<f64>,
    /// Size of a file, bytes.
    #[serde(default)]
    pub bytes: Option<f64>,
}

impl Published {
    /// Whether another row is of the same work, image size and background.
    pub(super) fn has_conditions_of(&self, other: &Self) -> bool {
        let conditions =
            |row: &Self| (row.name.clone(), row.source.clone(), row.resolution, row.background.map(f32::to_bits));
        conditions(self) == conditions(other)
    }
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

impl Study {
    /// The study with this name, or in this file: a name without a folder and without `.toml` is that of a built-in
    /// study.
    ///
    /// # Errors
    /// [`TrainError::Input`] that says what is wrong, and where.
    pub fn load(name_or_path: &str) -> Result<Self, TrainError> {
        let plain = !name_or_path.ends_with(".toml") && !name_or_path.contains(['/', '\\']);
        if plain {
            let text = catalog::text(name_or_path).ok_or_else(|| {
                let unknown = UnknownChoice::new("study", name_or_path, catalog::NAMES);
                TrainError::Input(format!("{unknown}; a file of your own ends in .toml"))
            })?;
            return Self::from_toml(text, &format!("study \"{name_or_path}\""));
        }
        let failed = |error| TrainError::Input(format!("{name_or_path}: cannot read the study: {error}"));
        let text = read_regular_text(Path::new(name_or_path), MAX_CONFIG_BYTES).map_err(failed)?;
        Self::from_toml(&text, name_or_path)
    }

    /// Reads a study from text; `origin` names it in errors.
    ///
    /// # Errors
    /// [`TrainError::Input`] that says what is wrong, and where.
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, TrainError> {
        let study: Self = toml::from_str(text).map_err(|error| {
            let line = error.span().map(|span| 1 + text.bytes().take(span.start).filter(|byte| *byte == b'\n').count());
            let line = line.map(|line| format!(":{line}")).unwrap_or_default();
            let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
            TrainError::Input(format!("{origin}{line}: {message}. docs/studies.md has every key of a study"))
        })?;
        match study.problem() {
            Some(problem) => Err(TrainError::Input(format!("{origin}: {problem}"))),
            None => Ok(study),
        }
    }

    /// The first problem that the types do not exclude.
    fn problem(&self) -> Option<String> {
        if self.axis.is_empty() {
            return Some("`axis` is empty: nothing varies; give at least one [[axis]]".to_owned());
        }
        if self.outputs.is_empty() {
            return Some(format!("`outputs` is empty; name at least one of {}", Output::NAMES.join(", ")));
        }
        if let Some(problem) = self.axes_problem() {
            return Some(problem);
        }
        let variants = self.axis.iter().map(|axis| axis.value.len()).try_fold(1usize, usize::checked_mul);
        if variants.is_none_or(|count| count > MOST_VARIANTS) {
            return Some(format!("the axes make more than {MOST_VARIANTS} variants; take values away"));
        }
        if self.outputs.contains(&Output::Curves) && self.curves.is_none() {
            return Some("`outputs` has \"curves\", so `[curves]` must say `along` which axis they run".to_owned());
        }
        if let Some(curves) = &self.curves
            && !self.axis.iter().any(|axis| axis.name == curves.along)
        {
            let names = self.axis.iter().map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", ");
            return Some(format!(
                "`curves.along` is \"{}\", which is no axis; it must be one of {names}",
                curves.along
            ));
        }
        let along = self.curves.as_ref().map(|curves| curves.along.as_str());
        for axis in self.axis.iter().filter(|axis| Some(axis.name.as_str()) != along) {
            if let Some(value) = axis.value.iter().find(|value| value.role != Role::Point) {
                return Some(format!(
                    "`role` of \"{}\" is \"{}\", but axis \"{}\" is not the one of `curves.along`; remove the key",
                    value.name, value.role, axis.name
                ));
            }
        }
        for published in &self.published {
            let size = published.bytes.is_none_or(|bytes| bytes.is_finite() && bytes > 0.0);
            if !(published.psnr.is_finite() && published.ssim.is_none_or(f64::is_finite) && size) {
                return Some(format!("`published` \"{}\" needs finite figures, and bytes above 0", published.name));
            }
        }
        None
    }

    fn axes_problem(&self) -> Option<String> {
        let mut axes = BTreeSet::new();
        for axis in &self.axis {
            if !axes.insert(&axis.name) {
                return Some(format!("two axes are called \"{}\"; rename one", axis.name));
            }
            if axis.value.is_empty() {
                return Some(format!("axis \"{}\" has no `value`; give at least one", axis.name));
            }
            let mut values = BTreeSet::new();
            for value in &axis.value {
                let legal = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '-';
                let plain =
                    value.name.chars().all(legal) && value.name.starts_with(|c: char| c.is_ascii_alphanumeric());
                if !plain || value.name.len() > 64 {
                    return Some(format!(
                        "axis \"{}\": `name` is {:?}; it becomes a folder, so it begins with a letter or digit, has \
                         letters, digits, `.` and `-` only, and 64 of them at most",
                        axis.name, value.name
                    ));
                }
                if let Some(problem) = value.schedule.and_then(schedule_problem) {
                    return Some(format!("axis \"{}\": `schedule` of \"{}\" {problem}", axis.name, value.name));
                }
                if !values.insert(&value.name) {
                    return Some(format!(
                        "axis \"{}\" has two values called \"{}\"; rename one",
                        axis.name, value.name
                    ));
                }
            }
        }
        None
    }

    /// Whether an output is to be made.
    pub fn shows(&self, output: Output) -> bool {
        self.outputs.contains(&output)
    }
}

impl AxisValue {
    /// For tables and plots.
    pub fn label(&self) -> &str {
        self.label.as_deref().unwrap_or(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
title = "t"
reproduces = "nothing"
outputs = ["table"]
[[axis]]
name = "a"
value = [{ name = "x" }, { name = "y", set = ["seed=1"] }]
"#;

    #[track_caller]
    fn refused(text: &str, words: &[&str]) {
        let error = Study::from_toml(text, "mine.toml").unwrap_err().to_string();
        for word in words.iter().chain(&["mine.toml"]) {
            assert!(error.contains(word), "`{word}` is not in: {error}");
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        assert!(Study::from_toml(GOOD, "mine.toml").is_ok());
        refused("", &["title"]);
        refused("title = 3", &["mine.toml:1", "string"]);
        refused(&GOOD.replace("\"table\"", "\"tabel\""), &["mine.toml:4", "tabel", "nearest is `table`"]);
        refused(&GOOD.replace("\"table\"", ""), &["`outputs` is empty", "curves"]);
        refused(&GOOD.replace("reproduces", "reproduce"), &["mine.toml:3", "reproduce"]);
        refused(&GOOD.replace("\"table\"", "\"curves\""), &["`[curves]`", "along"]);
        refused(&GOOD.replace("\"y\"", "\"x\""), &["axis \"a\"", "two values called \"x\""]);
        refused(&GOOD.replace("\"y\"", "\"../y\""), &["../y", "folder"]);
        refused(&GOOD.replace("\"y\"", "\"\""), &["folder"]);
        refused(&GOOD.replace("\"y\"", "\"y\", schedule = 0"), &["`schedule` of \"y\" is 0", "0.001 to 1000"]);
        refused(&GOOD.replace("\"y\"", "\"y\", schedule = nan"), &["is NaN"]);
        refused(&GOOD.replace("\"y\"", "\"..\""), &["folder"]);
        refused(
            &GOOD.replace("value = [{ name = \"x\" }, { name = \"y\", set = [\"seed=1\"] }]", "value = []"),
            &["no `value`"],
        );
        refused(&format!("{GOOD}\n[[axis]]\nname = \"a\"\nvalue = [{{ name = \"z\" }}]"), &["two axes", "\"a\""]);
        refused(&format!("{GOOD}\n[curves]\nalong = \"b\""), &["\"b\"", "one of a"]);
        refused(&GOOD.replace("name = \"x\"", "name = \"x\", role = \"bound\""), &["`role`", "remove"]);
        refused(&GOOD.replace("name = \"x\"", "name = \"x\", role = \"bond\""), &["bond", "bound"]);
        refused("title = \"t\"\nreproduces = \"\"\noutputs = [\"table\"]\naxis = []", &["[[axis]]"]);
        let wide: String = (0..101).map(|i| format!("{{ name = \"v{i}\" }},")).collect();
        let axes: String = ["a", "b"].iter().map(|n| format!("[[axis]]\nname = \"{n}\"\nvalue = [{wide}]\n")).collect();
        refused(&format!("title = \"t\"\nreproduces = \"\"\noutputs = [\"table\"]\n{axes}"), &["10000"]);
    }

    #[test]
    fn names_are_not_paths() {
        let error = Study::load("context-modle").unwrap_err().to_string();
        assert!(error.contains("context-model") && error.contains(".toml"), "{error}");
        let error = Study::load("no/such.toml").unwrap_err().to_string();
        assert!(error.contains("no/such.toml"), "{error}");
    }
}
