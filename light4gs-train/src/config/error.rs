//! What can be wrong with a configuration, and where it stands.

use std::fmt;
use std::path::PathBuf;

use light4gs_keys::Problem;

/// Where a layer of the configuration comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A preset of the binary.
    Preset(String),
    /// A file.
    File(PathBuf),
    /// An override of the command line, or other text.
    Text(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Preset(name) => write!(formatter, "preset \"{name}\""),
            Origin::File(path) => write!(formatter, "{}", path.display()),
            Origin::Text(name) => write!(formatter, "{name}"),
        }
    }
}

/// A configuration that cannot be used. Every variant is wrong input, none a fault of the program.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A file that cannot be read.
    #[error("{}: cannot read the configuration: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Text that is not TOML. The message does not quote the text: `extends` may name any file, even a secret one.
    #[error("{origin}{}: not valid TOML: {message}", at_line(*line))]
    Syntax {
        /// Where.
        origin: Origin,
        /// Line, from 1, where known.
        line: Option<usize>,
        /// The message of the parser.
        message: String,
    },
    /// A key that does not exist.
    #[error("{origin}{}: unknown key `{key}`; the nearest known key is `{nearest}`", at_line(*line))]
    UnknownKey {
        /// Where.
        origin: Origin,
        /// Line, from 1, where known.
        line: Option<usize>,
        /// Full path of the key.
        key: String,
        /// Full path of the known key most like it.
        nearest: String,
    },
    /// A value of the wrong type.
    #[error("{origin}{}: `{key}` must be {expected}, found {found}", at_line(*line))]
    WrongType {
        /// Where.
        origin: Origin,
        /// Line, from 1, where known.
        line: Option<usize>,
        /// Full path of the key.
        key: String,
        /// The type of the key's values.
        expected: String,
        /// What was given.
        found: String,
    },
    /// A value that does not fit into its field.
    #[error("{origin}: {message}")]
    Value {
        /// Where.
        origin: Origin,
        /// The message of the deserializer, with the key.
        message: String,
    },
    /// A preset that does not exist.
    #[error("no configuration file and no preset is called \"{name}\"{}; the nearest preset is \"{nearest}\" (presets: {})", asked_by(.by), super::preset_names().join(", "))]
    UnknownPreset {
        /// What was asked for.
        name: String,
        /// Which layer extends it.
        by: Option<Origin>,
        /// The preset most like it.
        nearest: String,
    },
    /// No configuration is named, and there is no preset for the dataset's layout.
    #[error("there is no preset for datasets of the layout `{layout}`: name one, or a file (presets: {})", super::preset_names().join(", "))]
    NoPreset {
        /// The layout's name.
        layout: &'static str,
    },
    /// Files that extend each other in a circle.
    #[error("`extends` runs in a circle: {}", chain.iter().map(ToString::to_string).collect::<Vec<_>>().join(" -> "))]
    Cycle {
        /// The circle, its first member repeated at the end.
        chain: Vec<Origin>,
    },
    /// A layer laid on top by `+` that would replace everything below it.
    #[error("{origin} extends another configuration, so it cannot follow a `+`: name it first, or alone")]
    LayerExtends {
        /// The layer.
        origin: Origin,
    },
    /// An override that is not `key=value`.
    #[error("override `{text}`: {message}")]
    Override {
        /// The override.
        text: String,
        /// The fault.
        message: String,
    },
    /// Values out of range.
    #[error("invalid configuration:{}", problems.iter().map(|p| format!("\n  `{}` {}", p.key, p.message)).collect::<String>())]
    Invalid {
        /// All of them.
        problems: Vec<Problem>,
    },
}

fn at_line(line: Option<usize>) -> String {
    line.map(|line| format!(":{line}")).unwrap_or_default()
}

fn asked_by(by: &Option<Origin>) -> String {
    by.as_ref().map(|origin| format!(" (asked for by {origin})")).unwrap_or_default()
}
