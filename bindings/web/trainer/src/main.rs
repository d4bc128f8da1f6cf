//! Trains a scene in a tab: compiled for WebAssembly (`wasm32-wasip1`), with a file system in memory, in a worker of the
//! page that `light4gs view --trainer` serves.
//!
//! ```text
//! light4gs-web-trainer DATASET RUN [KEY=VALUE...]
//! ```
//!
//! A DATASET that is not there is made: the synthetic scene of `light4gs quickstart`, with its preset. Any other begins
//! with the preset of its layout. RUN is the folder of a run, as everywhere.
//!
//! Standard output is a message a line, each an object with a `kind`; files that messages name are complete:
//!
//! | kind | fields |
//! |---|---|
//! | `stage` | `stage`, `iterations` |
//! | `log` | those of a line of `metrics.jsonl` |
//! | `picture` | `file`: a PNG, a training view as rendered and, on its right, as it should be |
//! | `scene` | `file`: a `.l4gs` stream without loss; `status`: the training position |
//! | `fit` | `done`, `iterations`: entropy models are fitted |
//! | `warning` | `text` |
//! | `done` | `file`, `report`: the coded stream and the report; `bytes`, `psnr`, `seconds` |
//! | `error` | `text` |

mod messages;
mod observer;
#[cfg(all(feature = "old-wasi-libc", target_os = "wasi"))]
mod old_wasi_libc;

use std::path::Path;
use std::process::ExitCode;

use light4gs_data::{Layouts, Scene, SyntheticOptions, write_synthetic};
use light4gs_model::BuiltInField;
use light4gs_report::evaluate_run;
use light4gs_train::config::{Config, DeviceName};
use light4gs_train::dataset::load_options;
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;
use light4gs_train::trainer::Trainer;
use serde_json::json;

use messages::say;
use observer::Messages;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.as_slice() {
        [dataset, run, overrides @ ..] => train(Path::new(dataset), Path::new(run), overrides),
        _ => Err(TrainError::Input("usage: light4gs-web-trainer DATASET RUN [KEY=VALUE...]".into())),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say(&json!({ "kind": "error", "text": error.to_string() }));
            ExitCode::FAILURE
        }
    }
}

fn train(dataset: &Path, run: &Path, overrides: &[String]) -> Result<(), TrainError> {
    let preset = if dataset.exists() {
        Config::preset_of(Layouts::default().detect(dataset)?)?
    } else {
        write_synthetic(dataset, &SyntheticOptions::default())?;
        "quickstart"
    };
    let config = Config { device: DeviceName::Flex, ..Config::load(preset, overrides)? };
    let data = Scene::open(dataset, &load_options(&config))?;
    let folder = RunFolder::create(run, Some(dataset), &config, true)?;
    let mut trainer =
        Trainer::builder(config.clone(), data).run_folder(folder.clone()).observer(Messages::new(run)).build()?;
    trainer.run()?;
    let evaluation = evaluate_run::<BuiltInField>(&folder, &config, trainer.data())?;
    let psnr = evaluation.splits.first().map(|split| split.scores.psnr());
    say(&json!({
        "kind": "done", "file": folder.stream(), "report": folder.path("report.html"),
        "bytes": evaluation.bytes, "psnr": psnr, "seconds": evaluation.training_seconds,
    }));
    Ok(())
}
