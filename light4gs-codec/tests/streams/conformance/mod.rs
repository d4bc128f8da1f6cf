//! The conformance set, `tests/conformance`, against this decoder: accepted files to the bit, and refused files.

mod forging;
mod takes;
#[path = "../../../examples/conformance/text.rs"]
mod text;
mod written;

use std::{fs, path::Path};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/conformance");
const TIMES: [&str; 5] = ["0", "0.25", "0.37", "0.5", "1"];

/// One file of the set.
#[derive(Default)]
struct Case {
    name: String,
    source: String,
    edits: Vec<forging::Edit>,
    /// None where the file is refused.
    lines: Option<Vec<String>>,
}

impl Case {
    fn bytes(&self) -> Vec<u8> {
        let path = Path::new(FOLDER).join("manifest").join(&self.source);
        let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        forging::forge(&bytes, &self.edits)
    }
}

/// The cases of a list. `tests/conformance/kit/manifest.py` says what stands in it.
fn cases(list: &str) -> Vec<Case> {
    let text = fs::read_to_string(Path::new(FOLDER).join("manifest").join(list)).unwrap();
    let mut cases: Vec<Case> = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')) {
        let (word, rest) = line.split_once(' ').unwrap();
        if matches!(word, "accepted" | "refused") {
            let lines = (word == "accepted").then(Vec::new);
            cases.push(Case { name: rest.into(), lines, ..Case::default() });
            continue;
        }
        let case = cases.last_mut().unwrap();
        match word {
            "from" => case.source = rest.into(),
            "edit" => case.edits.push(forging::Edit::parse(rest)),
            // Where the decoder in Python finds what is wrong.
            "expects" => {}
            _ => case.lines.as_mut().unwrap().push(line.into()),
        }
    }
    cases
}

#[test]
fn what_is_accepted_has_the_same_bits() {
    let cases = cases("accepted.txt");
    assert!(cases.len() > 20);
    for case in cases {
        let found = text::lines(&case.bytes(), &TIMES).unwrap_or_else(|error| panic!("{}: {error}", case.name));
        assert_eq!(Some(found), case.lines, "{}", case.name);
    }
}

#[test]
fn what_breaks_a_rule_is_refused() {
    let cases = cases("refused.txt");
    assert!(cases.len() > 100);
    let accepted = |case: &&Case| text::lines(&case.bytes(), &TIMES).is_ok();
    let accepted: Vec<String> = cases.iter().filter(accepted).map(|case| case.name.clone()).collect();
    assert!(accepted.is_empty(), "{accepted:?}");
}
