//! Records: figures with where they come from, in the form of the files in `results/` of the repository, from which
//! `.ci/figures` makes the tables of the pages.

use std::fmt::{self, Display, Formatter};

use light4gs_train::provenance;
use light4gs_train::utc;
use serde::Serialize;
use serde_json::{Map, Value};

/// A row: figures and the names that tell it from other rows. A figure is a number, a text, or an object with `mean` and
/// `deviation`.
pub type Row = Map<String, Value>;

/// Where figures come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// What was typed.
    pub command: String,
    /// Of the program.
    pub commit: String,
    /// Processor and cores.
    pub machine: String,
    /// Day, UTC: `2026-11-23`; of several, the first and the last.
    pub date: String,
    /// Seeds of the runs, counted from 0; empty where nothing was trained.
    pub seeds: Vec<u64>,
}

impl Provenance {
    /// Of a measurement that this program makes now, without trainings.
    pub fn of_this_program(command: String) -> Self {
        let (commit, date) = (provenance::COMMIT.to_owned(), day(&utc::now()));
        Self { command, commit, machine: provenance::machine(), date, seeds: Vec::new() }
    }
}

/// The day of a moment as [`utc::now`] writes it.
pub fn day(moment: &str) -> String {
    moment.split(' ').next().unwrap_or_default().to_owned()
}

/// Figures with where they come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Where they come from.
    pub provenance: Provenance,
    /// In the order of a table.
    pub rows: Vec<Row>,
}

impl Display for Record {
    /// As JSON, one row a line, so that a change of one figure changes one line.
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let head = serde_json::to_string_pretty(&self.provenance).expect("plain data has a JSON form");
        let head = head.strip_suffix("\n}").expect("an object");
        let rows: Vec<String> = self.rows.iter().map(|row| format!("    {}", Value::Object(row.clone()))).collect();
        write!(formatter, "{head},\n  \"rows\": [\n{}\n  ]\n}}", rows.join(",\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_json_with_a_row_a_line() {
        let row = |scene: &str| Row::from_iter([("scene".to_owned(), scene.into()), ("psnr".to_owned(), 28.5.into())]);
        let provenance = Provenance::of_this_program("light4gs bench".to_owned());
        let text = Record { provenance, rows: vec![row("flag"), row("a\nb")] }.to_string();
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&json["command"], &json["rows"][1]["scene"]), (&"light4gs bench".into(), &"a\nb".into()));
        assert_eq!(text.lines().filter(|line| line.contains("psnr")).count(), 2, "{text}");
        assert_eq!(json["date"].as_str().map(str::len), Some(10));
        for key in ["commit", "machine"] {
            assert!(!json[key].as_str().unwrap().is_empty(), "{key}");
        }
    }
}
