//! Poses of images, through the program `colmap`.

use super::{Program, argument};
use crate::error::DataError;
use std::path::Path;
use std::process::Command;

/// The program.
pub(crate) const COLMAP: Program = Program {
    name: "colmap",
    variable: "LIGHT4GS_COLMAP",
    version_arguments: &["help"],
    oldest: (3, 6),
    install: "install it with `apt install colmap`, `brew install colmap` or from https://colmap.github.io",
};

/// A step of a reconstruction.
pub(crate) struct Step<'a> {
    /// COLMAP's command, such as `mapper`.
    pub(crate) command: &'a str,
    /// The groups of options that say whether a graphics card is used: their names before and since COLMAP 3.12.
    pub(crate) gpu_groups: &'a [&'a str],
    /// What is done, for messages.
    pub(crate) attempt: &'a str,
    /// What to do if it fails.
    pub(crate) remedy: &'a str,
}

/// Runs a step. `arguments` adds the input and output; `line` is called with every line that it prints.
///
/// # Errors
/// [`DataError::Program`] where COLMAP is absent or fails.
pub(crate) fn run(
    step: &Step,
    arguments: impl FnOnce(&mut Command),
    line: &mut dyn FnMut(&str),
) -> Result<(), DataError> {
    let mut command = COLMAP.command();
    // COLMAP is linked with a window system, which may be absent.
    command.env("QT_QPA_PLATFORM", "offscreen").arg(step.command);
    if !step.gpu_groups.is_empty() {
        // Most builds of Linux distributions cannot use a graphics card; they end with an error if asked to.
        let help =
            COLMAP.output(COLMAP.command().env("QT_QPA_PLATFORM", "offscreen").args([step.command, "--help"]))?;
        let help = String::from_utf8_lossy(&[help.stdout, help.stderr].concat()).into_owned();
        let known = step.gpu_groups.iter().map(|group| format!("--{group}.use_gpu")).find(|name| help.contains(name));
        if let Some(name) = known {
            command.arg(name).arg(argument(0));
        }
    }
    arguments(&mut command);
    let mut quoted = |text: &str| {
        line(text);
        true
    };
    COLMAP.stream(&mut command, &mut quoted, step.attempt, step.remedy)
}

/// The two numbers of `... [3/20]`, as COLMAP counts images.
pub(crate) fn counted(line: &str) -> Option<(usize, usize)> {
    let inside = line.rsplit_once('[')?.1.split_once(']')?.0;
    let (done, total) = inside.split_once('/')?;
    Some((done.trim().parse().ok()?, total.trim().split(',').next()?.parse().ok()?))
}

/// The last number in parentheses, as the mapper counts images: `Registering image #5 (6)`.
pub(crate) fn registered(line: &str) -> Option<usize> {
    if !line.contains("Registering image #") {
        return None;
    }
    line.rsplit_once('(')?.1.split_once(')')?.0.trim().parse().ok()
}

/// A path as an argument.
pub(crate) fn path_argument<'a>(command: &'a mut Command, name: &str, path: &Path) -> &'a mut Command {
    command.arg(name).arg(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_colmap_counts() {
        assert_eq!(counted("Processed file [3/20]"), Some((3, 20)));
        assert_eq!(counted("Matching image [7/20] in 0.1s"), Some((7, 20)));
        assert_eq!(counted("I2024 x.cc:254] Processed file [1/2]"), Some((1, 2)));
        assert_eq!(counted("Name: a.png"), None);
        assert_eq!(registered("Registering image #5 (6)"), Some(6));
        assert_eq!(registered("=> Image sees 5 (6)"), None);
    }
}
