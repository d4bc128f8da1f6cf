//! The command of this process as a shell takes it, for records.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Such as `RAYON_NUM_THREADS=1 light4gs study sizes dnerf/flag --out runs/sizes`: the number of threads where it is set, the
/// program without its folder, and the arguments as they were given.
pub(super) fn command_line() -> String {
    let threads = env::var("RAYON_NUM_THREADS").ok().map(|count| format!("RAYON_NUM_THREADS={}", quoted(&count)));
    // A program with trainings of its own has another name.
    let program = env::args_os().next().map(PathBuf::from);
    let program = program.as_deref().and_then(Path::file_stem).map_or("light4gs".into(), OsStr::to_string_lossy);
    let arguments = env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    threads.into_iter().chain([quoted(&program)]).chain(arguments).collect::<Vec<_>>().join(" ")
}

fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_-+=./:,@%".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        return argument.to_owned();
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_shell_reads_back_what_was_given() {
        for (argument, text) in [
            ("dnerf/flag", "dnerf/flag"),
            ("hexplane-dnerf-{scene}-cpu", "'hexplane-dnerf-{scene}-cpu'"),
            ("", "''"),
            ("it's", r"'it'\''s'"),
        ] {
            assert_eq!(quoted(argument), text);
        }
    }
}
