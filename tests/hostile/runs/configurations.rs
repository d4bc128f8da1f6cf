//! Odd configurations: values at and beyond the ends of their ranges, of the wrong type, several at once.

use light4gs_train::config::{Bounds, Config, KEYS, Key};
use rand::Rng;
use rand::seq::IndexedRandom;

/// Keys for a run of a few iterations on a few Gaussians, with everything that compresses.
pub const TINY: &str = r#"
device = "flex"
data.resolution = 16
data.initial_points = 60
model.hexplane = { channels = 4, resolution = [8, 8, 8, 4] }
model.deformation.width = 8
train.coarse_iterations = 1
train.fine_iterations = 3
train.densify.adaptive = { from = 0, until = 2, interval = 1, prune_from = 0, prune_interval = 1, prune_above = 0, max_gaussians = 500 }
train.prune.iterations = [3]
train.prune.fraction = 0.1
compression.rate = { lambda = 0.01, from = 1, planes_until = 2, interval = 1 }
compression.steps.adaptive_from = 1
compression.context.fit_iterations = 2
eval = { interval = 1, views = 1, fps_warmup = 0, fps_frames = 1 }
"#;

/// [`TINY`] with other values for some keys, as the text of a configuration; each later pair wins.
pub fn tiny_with(pairs: &[(&str, &str)]) -> String {
    let mut table: toml::Table = TINY.parse().expect("TOML");
    for (key, value) in pairs {
        let layer: toml::Table = format!("{key} = {value}").parse().expect("TOML");
        merge(&mut table, layer);
    }
    table.to_string()
}

fn merge(base: &mut toml::Table, top: toml::Table) {
    for (key, value) in top {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(top)) => merge(base, top),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// The ends of the range of a key, as TOML.
pub fn ends(bounds: &Bounds) -> Vec<String> {
    match bounds {
        Bounds::Flag => ["true", "false"].map(str::to_owned).to_vec(),
        Bounds::Text => vec!["\"\"".to_owned()],
        // A named layout needs a dataset in that layout.
        Bounds::NameOrNone { .. } => vec!["\"\"".to_owned()],
        Bounds::Name(choices) => choices.names.iter().map(|name| format!("\"{name}\"")).collect(),
        // The name of a device.
        Bounds::Parsed { .. } => ["\"ndarray\"", "\"flex\""].map(str::to_owned).to_vec(),
        Bounds::Whole { least, most } => vec![least.to_string(), most.to_string()],
        Bounds::WholeOrNone { least, most } => vec!["0".to_owned(), least.to_string(), most.to_string()],
        Bounds::Number { least, most } => [least, most].map(|value| format!("{value:e}")).to_vec(),
        // The files would have to exist.
        Bounds::List { element: Bounds::Text, .. } => vec!["[]".to_owned()],
        Bounds::List { element, length } => ends(element)
            .into_iter()
            .map(|value| format!("[{}]", vec![value; length.unwrap_or(1)].join(", ")))
            .collect(),
        // An attribute that all Gaussians have.
        Bounds::ByName(each) => ends(each).into_iter().map(|value| format!("{{ means = {value} }}")).collect(),
    }
}

/// Values of the wrong type, out of range, or unusual.
const ODD: [&str; 22] = [
    "-1",
    "0",
    "1",
    "2",
    "3.5",
    "1e39",
    "-1e39",
    "1e-45",
    "3e38",
    "nan",
    "inf",
    "-inf",
    "true",
    "\"\"",
    "\"flex\"",
    "[]",
    "[1]",
    "[1, 2, 3, 4]",
    "9223372036854775807",
    "1979-05-27",
    "{}",
    "17",
];

/// A configuration with a few odd keys, and a description of them.
pub fn odd(random: &mut impl Rng) -> String {
    let mut pairs = Vec::new();
    for _ in 0..random.random_range(1..4) {
        let Key { path, bounds, .. } = KEYS.choose(random).expect("some");
        let value = if random.random() {
            ends(bounds).choose(random).expect("some").clone()
        } else {
            (*ODD.choose(random).expect("some")).to_owned()
        };
        pairs.push((path.as_str(), value));
    }
    let pairs: Vec<(&str, &str)> = pairs.iter().map(|(key, value)| (*key, value.as_str())).collect();
    tiny_with(&pairs)
}

/// Whether a few iterations with a configuration are quick and need little memory.
pub fn is_cheap(config: &Config) -> bool {
    let planes = &config.model.fields.hexplane.hexplane;
    let largest = planes.multipliers.last().copied().unwrap_or(1);
    let area = planes.resolution.iter().map(|side| side * largest).max().unwrap_or(0).pow(2);
    let network = &config.model.fields.hexplane.deformation;
    planes.channels <= 64
        && area * planes.channels * planes.multipliers.len() <= 1 << 18
        && network.width * network.width * network.depth.max(1) <= 1 << 18
        && config.data.initial_points <= 5000
        && config.data.resolution.is_some_and(|side| side <= 64)
        && config.train.batch_size <= 16
        && config.compression.context.fit_iterations <= 20
}
