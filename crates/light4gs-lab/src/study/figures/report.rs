//! `report.html` of a study: its tables, curves and images.

use std::fmt::Write as _;

use light4gs_report::{escape, page_of};
use light4gs_train::error::TrainError;

use super::Figure;
use crate::study::manifest::{Manifest, StudyFolder};
use crate::study::quality_curves::QualityCurves;
use crate::study::results::Results;
use crate::study::table::{StudyTable, legend};

/// Writes `report.html` and the files of all figures.
///
/// # Errors
/// [`TrainError::Input`] for a plot or an image that cannot be shown; [`TrainError::Data`] for a file that cannot be written.
pub fn write_report(
    folder: &StudyFolder,
    manifest: &Manifest,
    results: &Results,
    tables: &[StudyTable],
    curves: &[QualityCurves],
    figures: &[Figure],
) -> Result<(), TrainError> {
    let path = folder.path("figures");
    std::fs::create_dir_all(&path).map_err(light4gs_data::DataError::io("create", &path))?;
    let mut sections = vec![("Tables".to_owned(), tables_section(manifest, tables))];
    if !results.missing.is_empty() {
        sections.push(("Missing".to_owned(), missing_section(results)));
    }
    let deltas: String = curves.iter().map(differences).collect();
    if !deltas.is_empty() {
        sections.push(("Bjøntegaard's differences".to_owned(), deltas));
    }
    for figure in figures {
        figure.write(folder)?;
        let html = figure.to_html()?;
        match sections.iter_mut().find(|(heading, _)| heading == figure.section) {
            Some((_, section)) => *section += &html,
            None => sections.push((figure.section.to_owned(), html)),
        }
    }
    let study = &manifest.study;
    let about = format!("Reproduces: {}. Version {}.", study.reproduces, manifest.version);
    folder.write("report.html", page_of(&study.title, &about, &sections).as_bytes())
}

fn tables_section(manifest: &Manifest, tables: &[StudyTable]) -> String {
    let mut html = String::new();
    if !manifest.study.notes.is_empty() {
        let _ = writeln!(html, "<p>{}</p>", escape(manifest.study.notes.trim()));
    }
    for table in tables {
        let heading = std::iter::once(&table.heading).chain(&table.columns);
        html += &html_table(heading.cloned().collect(), table.lines());
    }
    let _ = writeln!(html, "<p>{}</p>", escape(&legend(manifest)));
    html
}

fn missing_section(results: &Results) -> String {
    let items = results.missing.iter().map(|missing| {
        let (run, state) = (escape(&missing.run), escape(&missing.state));
        format!("<li><b>{run}</b>: {state}</li>\n")
    });
    format!("<ul>\n{}</ul>\n", items.collect::<String>())
}

fn differences(curves: &QualityCurves) -> String {
    curves.differences().map(|(headings, rows)| html_table(headings, rows)).unwrap_or_default()
}

fn html_table(heading: Vec<String>, lines: Vec<Vec<String>>) -> String {
    let mut html = String::from("<div class=\"scroll\"><table>\n<thead><tr>");
    for (index, cell) in heading.iter().enumerate() {
        let class = if index > 0 { " class=\"number\"" } else { "" };
        let _ = write!(html, "<th scope=\"col\"{class}>{}</th>", escape(cell));
    }
    html += "</tr></thead>\n<tbody>\n";
    for line in lines {
        html += "<tr>";
        for (index, cell) in line.iter().enumerate() {
            let cell = escape(cell);
            match index {
                0 => drop(write!(html, "<th scope=\"row\">{cell}</th>")),
                _ => drop(write!(html, "<td class=\"number\">{cell}</td>")),
            }
        }
        html += "</tr>\n";
    }
    html + "</tbody>\n</table></div>\n"
}
