//! Studies: the paper's tables and figures, each a TOML file with the axes that vary and the outputs.
//!
//! From a file to a report: [`Study`], [`Plan`], [`Manifest`], [`results::Results`], then [`table`], [`quality_curves`] and
//! [`figures`].
//!
//! - [`definition`]: such a file; [`catalog`]: those of the paper, embedded in the program
//! - [`plan`]: variants x scenes x seeds, each a run with a configuration; runs with equal training are trained once
//! - [`selection`]: some of these runs, by parts of their names
//! - [`manifest`]: `study.json`, the plan of a study's folder
//! - [`measure`]: the measures of a run, and the columns of tables
//! - [`results`]: the results of the runs so far, `results.json` and the CSV files; [`reuse`]: trainings of other
//!   studies; [`remaining`]: the time that missing runs will take
//! - [`table`]: means, spreads and differences to the reference; [`rows`]: the same as a record, for pages
//! - [`quality_curves`]: runs as curves of quality over bytes or minutes
//! - `plots`, `figures`: plots and images, and the study's `report.html`
//! - [`curve`]: convex hulls and Bjøntegaard's differences; [`spread`]: mean and spread over seeds

pub mod catalog;
pub mod curve;
pub mod definition;
pub mod figures;
pub mod manifest;
pub mod measure;
pub mod plan;
pub mod plots;
pub mod quality_curves;
pub mod remaining;
pub mod results;
pub mod reuse;
pub mod rows;
pub mod selection;
pub mod spread;
pub mod table;

pub use definition::Study;
pub use manifest::Manifest;
pub use plan::Plan;
