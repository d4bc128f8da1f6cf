//! External programs: found, asked for their version, run, and the last lines of their output reported.

pub(crate) mod colmap;
pub(crate) mod ffmpeg;

use crate::error::DataError;
use std::collections::VecDeque;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::process::{Command, Output, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Lines of a program's output that an error quotes.
const QUOTED_LINES: usize = 6;

/// What to do with a line of a program that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// It is quoted, should the program fail.
    Quote,
    /// It is not.
    Forget,
    /// The program is stopped.
    Stop,
}

/// A program that the user installs.
pub(crate) struct Program {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// An environment variable that names another file to run.
    pub(crate) variable: &'static str,
    /// How to ask for its version.
    pub(crate) version_arguments: &'static [&'static str],
    /// The oldest version that will do.
    pub(crate) oldest: (u32, u32),
    /// How to get it.
    pub(crate) install: &'static str,
}

impl Program {
    /// A command that runs it, with empty standard input.
    pub(crate) fn command(&self) -> Command {
        let file = std::env::var_os(self.variable).unwrap_or_else(|| self.name.into());
        let mut command = Command::new(file);
        command.stdin(Stdio::null());
        command
    }

    /// An error about this program.
    pub(crate) fn error(&self, problem: impl Into<String>, remedy: impl Into<String>) -> DataError {
        DataError::Program { program: self.name, problem: problem.into(), remedy: remedy.into() }
    }

    /// Its version, major and minor. A build from source may print no number; then it counts as the newest.
    ///
    /// # Errors
    /// [`DataError::Program`] where it is not installed or too old, with how to install it.
    pub(crate) fn version(&self) -> Result<(u32, u32), DataError> {
        let output = self.output(self.command().args(self.version_arguments))?;
        let text = [output.stdout, output.stderr].concat();
        let version = version_in(&String::from_utf8_lossy(&text)).unwrap_or((u32::MAX, 0));
        if version < self.oldest {
            let ((major, minor), (least_major, least_minor)) = (version, self.oldest);
            let problem =
                format!("version {major}.{minor} is installed, expected {least_major}.{least_minor} or newer");
            return Err(self.error(problem, self.install));
        }
        Ok(version)
    }

    /// Runs a command of this program to its end.
    ///
    /// # Errors
    /// [`DataError::Program`] where it cannot be started.
    pub(crate) fn output(&self, command: &mut Command) -> Result<Output, DataError> {
        command.output().map_err(|e| self.not_started(&e))
    }

    /// The error for a command of this program that did not start.
    pub(crate) fn not_started(&self, error: &std::io::Error) -> DataError {
        if error.kind() == ErrorKind::NotFound {
            return self.error("is not installed, or not in PATH", self.install);
        }
        self.error(format!("cannot be started: {error}"), format!("{}, or name it in {}", self.install, self.variable))
    }

    /// Runs a command of this program, which must succeed.
    ///
    /// # Errors
    /// [`DataError::Program`] with what was attempted and the last lines it wrote.
    pub(crate) fn run(&self, command: &mut Command, attempt: &str, remedy: &str) -> Result<Output, DataError> {
        let output = self.output(command)?;
        if output.status.success() {
            return Ok(output);
        }
        let words = last_lines(&[&output.stdout[..], &output.stderr[..]].concat());
        Err(self.error(format!("{attempt} failed ({}): {words}", output.status), remedy))
    }

    /// As [`Self::run`], calling `line` with every line that the program prints while it runs, and with `None` once a second
    /// while it prints none. Returns whether it ran to its end: `line` may stop it.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub(crate) fn stream(
        &self,
        command: &mut Command,
        line: &mut dyn FnMut(Option<&str>) -> Heard,
        attempt: &str,
        remedy: &str,
    ) -> Result<bool, DataError> {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| self.not_started(&e))?;
        let (sender, lines) = mpsc::channel::<String>();
        let streams: [Option<Box<dyn Read + Send>>; 2] = [
            child.stdout.take().map(|stream| Box::new(stream) as Box<dyn Read + Send>),
            child.stderr.take().map(|stream| Box::new(stream) as Box<dyn Read + Send>),
        ];
        for stream in streams.into_iter().flatten() {
            let sender = sender.clone();
            std::thread::spawn(move || {
                // Bytes that are not UTF-8 end a line's text, but not the reading.
                for bytes in BufReader::new(stream).split(b'\n').map_while(Result::ok) {
                    if sender.send(String::from_utf8_lossy(&bytes).into_owned()).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut last: VecDeque<String> = VecDeque::new();
        loop {
            let text = match lines.recv_timeout(Duration::from_secs(1)) {
                Ok(text) => Some(text),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            match (line(text.as_deref()), text) {
                (Heard::Stop, _) => {
                    // It may have ended by itself.
                    let _ = child.kill();
                    let _ = child.wait();
                    return Ok(false);
                }
                (Heard::Quote, Some(text)) => last.push_back(text),
                _ => {}
            }
            if last.len() > 4 * QUOTED_LINES {
                last.pop_front();
            }
        }
        let status = child.wait().map_err(|e| self.not_started(&e))?;
        if status.success() {
            return Ok(true);
        }
        let words = last_lines(last.make_contiguous().join("\n").as_bytes());
        Err(self.error(format!("{attempt} failed ({status}): {words}"), remedy))
    }
}

/// The first `X.Y` after the word `version`, or after the program's name.
fn version_in(text: &str) -> Option<(u32, u32)> {
    let after = ["version ", "COLMAP "].iter().find_map(|word| text.split_once(word))?.1;
    let word = after.split_whitespace().next()?.trim_start_matches(['n', 'v']);
    let mut parts = word.split(['.', '-', '+']);
    let major = parts.next()?.parse().ok()?;
    Some((major, parts.next().and_then(|part| part.parse().ok()).unwrap_or(0)))
}

/// The last non-empty lines of a program's output, joined to one line, without control characters.
pub(crate) fn last_lines(output: &[u8]) -> String {
    let text = String::from_utf8_lossy(output);
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let kept = lines[lines.len().saturating_sub(QUOTED_LINES)..].join(" | ");
    kept.chars().filter(|c| !c.is_control()).take(800).collect()
}

/// A number as a program's argument.
pub(crate) fn argument(value: impl ToString) -> impl AsRef<OsStr> {
    value.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions() {
        assert_eq!(version_in("ffmpeg version 5.1.9-0+deb12u1 Copyright"), Some((5, 1)));
        assert_eq!(version_in("ffmpeg version n7.0 Copyright"), Some((7, 0)));
        assert_eq!(version_in("COLMAP 3.8 -- Structure-from-Motion"), Some((3, 8)));
        assert_eq!(version_in("ffmpeg version N-109542-gabc"), None);
        assert_eq!(version_in(""), None);
    }

    #[test]
    fn an_absent_program_says_how_to_install_it() {
        let program = Program {
            name: "light4gs-no-such-program",
            variable: "LIGHT4GS_NO_SUCH_VARIABLE",
            version_arguments: &[],
            oldest: (1, 0),
            install: "install it with `apt install nothing`",
        };
        let message = program.version().unwrap_err().to_string();
        assert!(message.contains("is not installed") && message.contains("apt install nothing"), "{message}");
    }

    const SHELL: Program = Program {
        name: "sh",
        variable: "LIGHT4GS_NO_SUCH_VARIABLE",
        version_arguments: &[],
        oldest: (0, 0),
        install: "",
    };

    #[test]
    fn lines_are_heard_and_may_stop_the_program() {
        let mut command = SHELL.command();
        command.args(["-c", "echo one; echo two >&2; echo three; exit 1"]);
        let mut heard = Vec::new();
        let mut line = |line: Option<&str>| {
            heard.extend(line.map(str::to_owned));
            if line == Some("two") { Heard::Quote } else { Heard::Forget }
        };
        let message = SHELL.stream(&mut command, &mut line, "counting", "rest").unwrap_err().to_string();
        heard.sort();
        assert_eq!(heard, ["one", "three", "two"]);
        assert!(message.contains("counting failed") && message.ends_with(": two; rest"), "{message}");
        let mut command = SHELL.command();
        command.args(["-c", "echo begun; exec sleep 60"]);
        let begun = std::time::Instant::now();
        assert!(!SHELL.stream(&mut command, &mut |_| Heard::Stop, "waiting", "rest").unwrap());
        assert!(begun.elapsed() < Duration::from_secs(30));
    }

    #[test]
    fn failures_quote_the_last_words() {
        let shell = SHELL;
        let script = "echo first; printf 'bad \\033[31mthing\\n' >&2; exit 3";
        let message = shell.run(shell.command().args(["-c", script]), "trying", "try again").unwrap_err().to_string();
        assert!(message.contains("trying failed") && message.contains("bad [31mthing"), "{message}");
        assert!(!message.contains('\x1b') && message.ends_with("; try again"), "{message}");
    }
}
