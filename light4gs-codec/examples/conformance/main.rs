//! The decoder as a program that `tests/conformance/check` can run: conformance FILE TIME...
//!
//! Prints the checksums of all arrays. Ends with 1 and a message if the file is refused.

mod text;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((path, times)) = arguments.split_first() else {
        eprintln!("usage: conformance FILE TIME...");
        return ExitCode::from(64);
    };
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => {
            eprintln!("{path}: {error}");
            return ExitCode::from(66);
        }
    };
    let times: Vec<&str> = times.iter().map(String::as_str).collect();
    match text::lines(&bytes, &times) {
        Ok(lines) => {
            lines.iter().for_each(|line| println!("{line}"));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(1)
        }
    }
}
