//! COLMAP's program.

use super::{AGAIN, Effort, FILM_AGAIN, Job, Mapper, counted, registered};
use crate::error::DataError;
use crate::programs::{Heard, Program, argument};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// The program.
pub(crate) const COLMAP: Program = Program {
    name: "colmap",
    variable: "LIGHT4GS_COLMAP",
    version_arguments: &["help"],
    oldest: (3, 6),
    install: "install it with `apt install colmap`, `brew install colmap` or from https://colmap.github.io, or its Python \
              package, which is newer and faster, with `pip install pycolmap`",
};

/// The mapper is stopped where no further image gets a pose for so long, and for a share of the time that it has taken: it
/// then tries pair after pair without success. Models that it has finished are kept.
const PATIENCE: Duration = Duration::from_secs(75);

/// A command of the program. COLMAP is linked with a window system, which may be absent.
fn command(name: &str) -> Command {
    let mut command = COLMAP.command();
    command.env("QT_QPA_PLATFORM", "offscreen").arg(name);
    command
}

/// The options of a command, as its help lists them: their groups have other names since version 3.12.
struct Help(String);

impl Help {
    fn of(name: &str) -> Result<Self, DataError> {
        let help = COLMAP.output(command(name).arg("--help"))?;
        Ok(Self(String::from_utf8_lossy(&[help.stdout, help.stderr].concat()).into_owned()))
    }

    /// Adds the first of the options that exists, or none.
    fn add(&self, command: &mut Command, groups: &[&str], option: &str, value: impl ToString) {
        let names = groups.iter().map(|group| format!("--{group}.{option}"));
        // A name may begin another.
        let known = |name: &String| self.0.split_whitespace().any(|word| word == name);
        if let Some(name) = names.into_iter().find(known) {
            command.arg(name).arg(argument(value));
        }
    }
}

pub(super) fn features(job: &Job, effort: Effort, done: &mut dyn FnMut(usize)) -> Result<(), DataError> {
    let help = Help::of("feature_extractor")?;
    let groups = ["SiftExtraction", "FeatureExtraction"];
    let mut command = command("feature_extractor");
    command.arg("--database_path").arg(&job.database).arg("--image_path").arg(&job.images);
    command.arg("--image_list_path").arg(&job.list);
    command.args(["--ImageReader.camera_model", job.camera_model()]);
    command.args([if job.rig { "--ImageReader.single_camera_per_folder" } else { "--ImageReader.single_camera" }, "1"]);
    // Most builds of Linux distributions cannot use a graphics card; they end with an error if asked to.
    help.add(&mut command, &groups, "use_gpu", 0);
    help.add(&mut command, &groups, "max_image_size", effort.size);
    help.add(&mut command, &groups, "max_num_features", effort.features);
    help.add(&mut command, &groups, "first_octave", if effort.doubled { -1 } else { 0 });
    let mut line = |line: Option<&str>| {
        if let Some((count, _)) = line.and_then(counted) {
            done(count);
        }
        Heard::Quote
    };
    COLMAP.stream(&mut command, &mut line, "finding features", AGAIN).map(drop)
}

pub(super) fn matches(job: &Job, pairs: &Path) -> Result<(), DataError> {
    let help = Help::of("matches_importer")?;
    let mut command = command("matches_importer");
    command.arg("--database_path").arg(&job.database);
    command.arg("--match_list_path").arg(pairs).args(["--match_type", "pairs"]);
    help.add(&mut command, &["SiftMatching", "FeatureMatching"], "use_gpu", 0);
    COLMAP.run(&mut command, "matching features", AGAIN).map(drop)
}

pub(super) fn poses(job: &Job, sparse: &Path, mapper: Mapper, done: &mut dyn FnMut(usize)) -> Result<(), DataError> {
    let global = mapper == Mapper::Global;
    if global {
        // It estimates focal lengths, which a global mapper needs to know beforehand. Without it the poses are less exact.
        let mut calibrate = command("view_graph_calibrator");
        let _ = COLMAP.output(calibrate.arg("--database_path").arg(&job.database))?;
    }
    let mut command = command(if global { "global_mapper" } else { "mapper" });
    command.arg("--database_path").arg(&job.database).arg("--image_path").arg(&job.images);
    command.arg("--output_path").arg(sparse);
    let begun = Instant::now();
    let (mut most, mut since) = (0, begun);
    let mut none = false;
    let mut line = |line: Option<&str>| {
        none |= line.is_some_and(|line| line.contains("failed to create sparse model"));
        if let Some(count) = line.and_then(registered)
            && count > most
        {
            (most, since) = (count, Instant::now());
            done(count);
        }
        let stuck = !global && since.elapsed() > PATIENCE.max(begun.elapsed() / 3);
        if stuck { Heard::Stop } else { Heard::Quote }
    };
    let ended = COLMAP.stream(&mut command, &mut line, "finding poses", FILM_AGAIN);
    // That there is no model is a result, and not a failure.
    if none { Ok(()) } else { ended.map(drop) }
}
