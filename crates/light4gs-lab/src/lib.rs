//! The laboratory of Light4GS: studies of many trainings, and the benchmark of a training step.
//!
//! It stands above the libraries, which do without it. The program's commands `study`, `gather` and `bench` use it.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | read a study, built-in or from a file | [`Study::load`](study::Study::load) |
//! | know its runs and their configurations | [`Plan::new`](study::Plan::new) with [`PlanOptions`](study::plan::PlanOptions) |
//! | train them | [`StudyFolder::create`](study::manifest::StudyFolder::create), then a [`Trainer`](light4gs_train::trainer::Trainer) for each [`Manifest::task`](study::Manifest::task) |
//! | make tables of the finished runs | [`Results::read`](study::results::Results::read), [`tables`](study::table::tables), [`quality_curves`](study::quality_curves::quality_curves) |
//! | make the report with all plots | [`figures`](study::figures) |
//! | compare two curves of quality over bytes | [`convex_hull`](study::curve::convex_hull), [`bjontegaard`](study::curve::bjontegaard) |
//! | take mean and deviation over seeds | [`Spread`](study::spread::Spread) |
//! | draw a plot as SVG and PNG | [`study::plots`] |
//! | time the parts of a training step on a device | [`benchmark::benchmark`](benchmark::benchmark()), on a [`BenchScene`](benchmark::BenchScene) |
//! | time the entropy coders | [`codec_benchmark`](benchmark::codec::codec_benchmark) |
//! | write figures down with where they come from | [`Record`](record::Record), [`study::rows`] |
//!
//! **In short:** the commands of the program suffice for most studies; docs/studies.md describes their files.
//!
//! # Example
//!
//! A study with two variants, which differ in one key of the configuration.
//!
//! ```
//! use light4gs_lab::study::{Study, plan};
//!
//! let text = r#"
//! title = "Density control"
//! reproduces = "nothing: a question of one's own"
//! outputs = ["table"]
//!
//! [[axis]]
//! name = "strategy"
//! value = [
//!     { name = "adaptive" },
//!     { name = "none", set = ["train.densify.strategy=none"] },
//! ]
//! "#;
//! let study = Study::from_toml(text, "mine.toml")?;
//! let variants = plan::variants(&study.axis);
//! assert_eq!(variants.iter().map(|variant| &*variant.name).collect::<Vec<_>>(), ["adaptive", "none"]);
//! # Ok::<(), light4gs_train::error::TrainError>(())
//! ```

pub mod benchmark;
pub mod record;
pub mod study;
