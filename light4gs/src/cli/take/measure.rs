//! `eval` of a take, and `info` of its file.

use std::io::Write;
use std::path::Path;

use light4gs_codec::Limits;
use light4gs_codec::take::Take;
use light4gs_data::{Scene, write_atomically};
use light4gs_render::PlayableTake;
use light4gs_report::take_page;
use light4gs_train::config::Config;
use light4gs_train::dataset::{load_options, passing_images};
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};
use light4gs_train::take::{JoinScores, TakeEvaluation, TakeFolder, evaluate_take};
use serde_json::json;

use super::super::output::{say, say_json};

/// Measures the file of a take's folder, and writes `eval.json` and `report.html` there.
pub(in crate::cli) fn eval_folder(root: &Path, json: bool) -> Result<(), TrainError> {
    let folder = TakeFolder::open(root)?;
    if !folder.file().is_file() {
        let shown = root.display();
        return Err(TrainError::Input(format!(
            "{shown} has no take.l4gs yet; write it with `light4gs join {shown}`, which needs the base"
        )));
    }
    let evaluation = measured(&folder.file(), &folder.record().scene, folder.config(), &Limits::large())?;
    let text = serde_json::to_string_pretty(&evaluation).expect("plain data has a JSON form");
    write_atomically(&root.join("eval.json"), |file| writeln!(file, "{text}"))?;
    let title = root.file_name().map_or("take".into(), |name| name.to_string_lossy().into_owned());
    let page = root.join("report.html");
    write_atomically(&page, |file| file.write_all(take_page(&title, &evaluation).as_bytes()))?;
    print(&evaluation, json)?;
    if !json {
        say(format_args!("report: {}", page.display()))?;
    }
    Ok(())
}

/// Measures the file of a take on a dataset.
pub(in crate::cli) fn eval_file(
    file: &Path,
    scene: &Path,
    config: &Config,
    limits: &Limits,
    json: bool,
) -> Result<(), TrainError> {
    print(&measured(file, scene, config, limits)?, json)
}

fn measured(file: &Path, scene: &Path, config: &Config, limits: &Limits) -> Result<TakeEvaluation, TrainError> {
    let take = PlayableTake::open(file, limits)?;
    let bytes = std::fs::metadata(file).map_err(light4gs_data::DataError::io("read", file))?.len();
    let data = Scene::open(scene, &load_options(config))?;
    let device = device::open(config.device)?;
    evaluate_take(&take, bytes, &data, &passing_images(config), &device)
}

fn print(evaluation: &TakeEvaluation, json: bool) -> Result<(), TrainError> {
    if json {
        return say_json(evaluation);
    }
    let columns = ["", "all", "at joins", "elsewhere"].map(|name| (name, Align::Right));
    let mut table = Table::new(columns.map(|(name, align)| (name.to_owned(), align)));
    let mut row = |name: &str, scores: &JoinScores, digits: usize| {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
        table.row([name.to_owned(), number(scores.all), number(scores.at_joins), number(scores.elsewhere)]);
    };
    row("PSNR, dB", &evaluation.psnr, 2);
    row("SSIM", &evaluation.ssim, 4);
    row("flicker", &evaluation.flicker, 5);
    say(table)?;
    say(format_args!(
        "{} bytes in {} segments, {:.2} kB per frame; {} frames measured",
        evaluation.bytes,
        evaluation.segments,
        evaluation.kilobytes_a_frame,
        evaluation.frames.len()
    ))
}

/// Prints what a take holds, from its index.
pub(in crate::cli) fn info(file: &Path, limits: &Limits, json: bool) -> Result<(), TrainError> {
    let take = Take::open(file, limits)?;
    let index = take.index();
    let meta = index.meta();
    let base_bytes = index.base().end - index.base().start;
    if json {
        let segments: Vec<_> = index
            .segments()
            .iter()
            .map(|segment| {
                json!({"begin": segment.times.begin, "end": segment.times.end, "frames": segment.times.frames,
                    "offset": segment.offset, "bytes": segment.bytes})
            })
            .collect();
        return say_json(&json!({"take": true, "name": meta.name, "fps": meta.fps, "seconds": meta.seconds,
            "base": {"offset": index.base().start, "bytes": base_bytes, "gaussians": index.base_gaussians()},
            "segments": segments}));
    }
    say(format_args!("{}: a take of {:.2} seconds, {} frames per second", meta.name, meta.seconds, meta.fps))?;
    say(format_args!("base: {} Gaussians, {base_bytes} bytes\n", index.base_gaussians()))?;
    let names = ["segment", "from, s", "to, s", "frames", "bytes"];
    let mut table = Table::new(names.map(|name| (name.to_owned(), Align::Right)));
    for (number, segment) in index.segments().iter().enumerate() {
        let times = &segment.times;
        table.row([
            number.to_string(),
            format!("{:.2}", times.begin),
            format!("{:.2}", times.end),
            times.frames.to_string(),
            segment.bytes.to_string(),
        ]);
    }
    say(table)
}

/// Whether a file is a take.
pub(in crate::cli) fn is_take_file(path: &Path) -> bool {
    use std::io::Read;
    let mut first = Vec::new();
    // Not of a pipe, whose writer would be waited for.
    let regular = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    let read = regular.then(|| std::fs::File::open(path).and_then(|file| file.take(8).read_to_end(&mut first)));
    read.is_some_and(|read| read.is_ok()) && light4gs_codec::take::is_take(&first)
}
