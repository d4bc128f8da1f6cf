//! Runs every example. `cargo test -p light4gs-examples` builds them beside the tests, and they are found there.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The names of the examples: the files in `examples/`.
fn names() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut names: Vec<String> = files
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// `target/PROFILE/examples`: this program is in `target/PROFILE/deps`.
fn folder_of_programs() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().join("examples")
}

#[test]
fn every_example_succeeds() {
    let mut failures = Vec::new();
    for name in names() {
        let program = folder_of_programs().join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
        assert!(program.is_file(), "{} is missing: cargo test -p light4gs-examples builds it", program.display());
        let output = Command::new(&program).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        println!("{name}: {}\n{text}", output.status);
        if !output.status.success() {
            failures.push(format!("{name} ({}):\n{text}", output.status));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The index of the examples names each of them, and only those; the table of docs/extending.md has a row for each.
#[test]
fn the_index_is_complete() {
    let index = include_str!("../README.md");
    let table = include_str!("../../docs/extending.md");
    for name in names() {
        assert!(index.contains(&format!("(examples/{name}.rs)")), "examples/README.md does not name {name}");
        assert!(
            table.contains(&format!("[{name}](../examples/examples/{name}.rs)")),
            "docs/extending.md has no row for {name}"
        );
    }
    assert_eq!(index.matches("(examples/").count(), names().len());
}

/// Code that docs/extending.md quotes from an example stands in that example, line for line.
#[test]
fn quoted_code_is_the_examples() {
    let document = include_str!("../../docs/extending.md");
    let lines = |text: &str| text.lines().map(|line| line.trim().to_owned() + "\n").collect::<String>();
    let mut quotes = 0;
    for quote in document.split("<!-- quoted from ").skip(1) {
        let (name, rest) = quote.split_once(" -->").expect("a comment has an end");
        let code = rest.split("```rust\n").nth(1).and_then(|code| code.split("```").next()).expect("code follows");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("examples/{name}.rs"));
        let example = std::fs::read_to_string(&path).unwrap();
        assert!(lines(&example).contains(&lines(code)), "not in {}:\n{code}", path.display());
        quotes += 1;
    }
    assert!(quotes > 0);
}
