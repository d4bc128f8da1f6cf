//! The command line: one file for each command.

mod bench;
mod check;
mod command_line;
mod compare;
mod completions;
mod container;
mod export;
mod gpu_errors;
#[cfg(unix)]
pub mod hand_over;
mod import;
mod launch;
mod limits;
mod man;
mod output;
mod prepare;
mod program;
mod quickstart;
mod render;
mod report;
mod signals;
mod study;
mod synth;
mod take;
mod train;
mod training;
mod videos;
mod view;
mod wishes;

use std::path::Path;

use clap::{Parser, Subcommand};
use light4gs_train::error::TrainError;
use light4gs_train::run::belongs_to_run;

pub use program::Program;
use training::Trainings;

/// Learns a moving scene as 3D Gaussians and their motion, and stores it as one small .l4gs file.
#[derive(Debug, Parser)]
#[command(name = "light4gs", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a small synthetic scene, train on it, and write the file and the report.
    #[command(after_help = "Example:\n  light4gs quickstart --out runs/quickstart")]
    Quickstart(quickstart::Quickstart),
    /// Make a dataset from one or several videos: frames by ffmpeg, poses by COLMAP (the program, or the package pycolmap).
    #[command(after_help = "Examples:\n  light4gs prepare walk.mp4 --out data/walk\n  light4gs prepare left.mp4 \
                            middle.mp4 right.mp4 --out data/stage\n  light4gs train data/walk --out runs/walk")]
    Prepare(prepare::Prepare),
    /// Before anything is trained, print what is read from a dataset: cameras, times, lens, masks, points, unused
    /// images. The exit code is 2 if no training on this dataset can work.
    #[command(after_help = "Example:\n  light4gs check data/walk --html walk.html")]
    Check(check::Check),
    /// Train on a dataset, or on videos (which are first prepared).
    #[command(
        after_help = "Examples:\n  light4gs train data/dnerf/bouncing --out runs/bouncing\n  light4gs train walk.mp4 --out runs/walk"
    )]
    Train(train::Train),
    /// Continue a run from its last checkpoint. The result is the same as without the interruption.
    #[command(after_help = "Example:\n  light4gs resume runs/bouncing")]
    Resume(train::Resume),
    /// Measure the decoded file of a run or of a take: PSNR, SSIM, FPS, bytes by section.
    ///
    /// If the dataset has masks of moving pixels, PSNR and SSIM are also given for moving and for still pixels. docs/metrics.md
    /// explains every column.
    #[command(after_help = "Example:\n  light4gs eval runs/bouncing --json")]
    Eval(train::Eval),
    /// Render a file along a camera path while time runs, to a GIF, an MP4 or PNG frames.
    #[command(after_help = "Example:\n  light4gs render runs/bouncing/scene.l4gs --out bouncing.gif --frames 60")]
    Render(render::Render),
    /// Show a file, a run or a take in the browser, and follow a training.
    #[command(after_help = "Example:\n  light4gs view runs/bouncing --open")]
    View(view::View),
    /// Import a scene that another program has trained: a checkpoint of 4DGaussians, or a PLY file of 3DGS.
    #[command(
        after_help = "Examples:\n  light4gs import output/bouncing --from 4dgaussians --out runs/bouncing\n  light4gs import scene.ply --from ply --out scene.l4gs"
    )]
    Import(import::Import),
    /// Write the newest checkpoint of a run as a .l4gs file, for example in another size.
    #[command(after_help = "Example:\n  light4gs encode runs/bouncing --out bouncing.l4gs")]
    Encode(container::Encode),
    /// Unpack a .l4gs file to plain arrays (safetensors).
    #[command(after_help = "Example:\n  light4gs decode bouncing.l4gs --out bouncing.safetensors")]
    Decode(container::Decode),
    /// Print the contents of a .l4gs file, with the bytes of each section.
    #[command(after_help = "Example:\n  light4gs info bouncing.l4gs --json")]
    Info(container::Info),
    /// Write the scene for other programs (PLY files, .glb, .4dgs), or a page that plays it (--html, --site).
    #[command(
        after_help = "Examples:\n  light4gs export bouncing.l4gs --out frames --frames 30\n  light4gs export runs/bouncing --site bouncing"
    )]
    Export(export::Export),
    /// Make a synthetic dataset: the scene of the quickstart, or a take (--seconds).
    #[command(after_help = "Example:\n  light4gs synth data/synthetic --resolution 200")]
    Synth(synth::Synth),
    /// Make a table or a figure of the paper, or one of your own: train variants of a configuration on scenes, and compare them.
    #[command(
        after_help = "Example:\n  light4gs study context-model data/dnerf/flag --config hexplane-dnerf-flag-cpu --seeds 3 --out runs/context"
    )]
    Study(study::Study),
    /// Write the tables and the report of a study from its finished runs, and print which runs are missing.
    #[command(after_help = "Example:\n  light4gs gather runs/context")]
    Gather(study::Gather),
    /// One task of a study, as its launcher starts it.
    #[command(hide = true)]
    StudyTask(study::StudyTask),
    /// Write the file of a take from the segments that are finished. So you can play the first half of a take while the
    /// second half is in training.
    #[command(after_help = "Example:\n  light4gs join runs/walk")]
    Join(take::Join),
    /// Train what was filmed after the end of a take. The base and the segments of the take stay as they are.
    ///
    /// After an interruption, the same command continues the training.
    #[command(after_help = "Example:\n  light4gs extend runs/walk data/walk-longer")]
    Extend(take::Extend),
    /// One task of a take, as its launcher starts it.
    #[command(hide = true)]
    TakeTask(take::TakeTask),
    /// Print what differs between runs: program and machine, configuration, results.
    #[command(after_help = "Example:\n  light4gs compare runs/one runs/other")]
    Compare(compare::Compare),
    /// Print what a bug report needs: version, machine, devices, last error. The text contains none of your paths or
    /// names.
    #[command(after_help = "Example:\n  light4gs report")]
    Report(report::Report),
    /// Time every part of a training step on one or more devices.
    #[command(after_help = "Example:\n  light4gs bench --device ndarray,flex,wgpu --gaussians 20000 --size 400")]
    Bench(bench::Bench),
    /// Print the script with which a shell completes the arguments of light4gs.
    #[command(
        hide = true,
        after_help = "Example:\n  light4gs completions bash > ~/.local/share/bash-completion/completions/light4gs"
    )]
    Completions(completions::Completions),
    /// Write pages for `man`, one for each command.
    #[command(hide = true, after_help = "Example:\n  light4gs man --out ~/.local/share/man/man1")]
    Man(man::Man),
}

impl Cli {
    /// Runs the command. [`TrainError::exit_code`] of its error is the exit code.
    fn run(self, trainings: &Trainings) -> Result<(), TrainError> {
        match self.command {
            Command::Quickstart(command) => command.run(),
            Command::Prepare(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Train(command) => command.run(),
            Command::Resume(command) => command.run(),
            Command::Eval(command) => command.run(),
            Command::Render(command) => command.run(),
            Command::View(command) => command.run(),
            Command::Import(command) => command.run(),
            Command::Encode(command) => command.run(),
            Command::Decode(command) => command.run(),
            Command::Info(command) => command.run(),
            Command::Export(command) => command.run(),
            Command::Synth(command) => command.run(),
            Command::Study(command) => command.run(trainings),
            Command::Gather(command) => command.run(),
            Command::StudyTask(command) => command.run(trainings),
            Command::Join(command) => command.run(),
            Command::Extend(command) => command.run(),
            Command::TakeTask(command) => command.run(trainings),
            Command::Compare(command) => command.run(),
            Command::Report(command) => command.run(),
            Command::Bench(command) => command.run(),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(),
        }
    }
}

/// Refuses an output path before any work is done: if its folder does not exist, if it is a pipe or a device, or if it
/// would replace the file that the command reads or a file of a run.
fn check_output(path: &Path, source: &Path) -> Result<(), TrainError> {
    let refuse = |problem: String| Err(TrainError::Input(format!("cannot write {}: {problem}", path.display())));
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return refuse(format!("the folder {} does not exist; make it first", folder.display()));
    }
    if std::fs::metadata(path).is_ok_and(|metadata| !(metadata.is_file() || metadata.is_dir())) {
        return refuse("it is a pipe, a socket or a device; name a file".to_owned());
    }
    let whole = |path: &Path| std::fs::canonicalize(path).ok();
    if whole(path).is_some_and(|path| whole(source) == Some(path)) {
        return refuse("the command reads this file; name another".to_owned());
    }
    if belongs_to_run(path) {
        return refuse("the file belongs to a run, which needs it; name another".to_owned());
    }
    Ok(())
}
