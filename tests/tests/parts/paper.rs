//! docs/paper.md leads from the paper to the code: each file, key, preset and study in its tables exists.

use std::fs;

use crate::rooms::root;

#[test]
fn the_tables_name_what_exists() {
    let read = |name: &str| fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let (page, keys) = (read("docs/paper.md"), read("docs/configuration.md"));
    let named: Vec<&str> = page.lines().filter(|line| line.starts_with('|')).flat_map(quoted).collect();
    assert!(named.len() > 60, "{} names in the tables", named.len());
    let lacking: Vec<&str> = named.into_iter().filter(|name| !exists(name, &keys)).collect();
    assert!(lacking.is_empty(), "docs/paper.md names what is not there: {}", lacking.join(", "));
}

#[test]
fn a_wrong_name_is_found() {
    let keys = "### `[train.prune]`\n| `train.loss` | `\"photometric\"` |";
    for name in ["tests/README.md", "train.loss", "[train.prune]", "light4gs study latency", "paper-dnerf+paper-coding"]
    {
        assert!(exists(name, keys), "{name}");
    }
    for name in ["tests/NONE.md", "train.los", "[train.prun]", "light4gs study lateness", "paper-dnerf+none"] {
        assert!(!exists(name, keys), "{name}");
    }
}

/// The texts between backticks.
fn quoted(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

/// Whether there is a study, a file or folder, a table of keys, a key, or a combination of presets of this name. `keys` is the page
/// about the configuration, which a test of `light4gs-train` compares with the declarations.
fn exists(name: &str, keys: &str) -> bool {
    if let Some(study) = name.strip_prefix("light4gs study ") {
        root().join(format!("crates/light4gs-lab/configs/studies/{study}.toml")).is_file()
    } else if name.contains('/') {
        root().join(name).exists()
    } else if name.starts_with('[') {
        keys.contains(&format!("### `{name}`"))
    } else if name.contains('.') {
        keys.contains(&format!("| `{name}` |"))
    } else {
        name.split('+').all(is_preset)
    }
}

fn is_preset(name: &str) -> bool {
    let presets = root().join("light4gs-train/configs");
    let file = format!("{name}.toml");
    [".", "ablations", "captures", "dnerf-scenes", "papers"]
        .iter()
        .any(|folder| presets.join(folder).join(&file).is_file())
}
