//! Every configuration that is accepted can be trained: tested with both ends of every key's range, every word, true
//! and false.

use std::path::Path;

use light4gs_data::{SyntheticOptions, write_synthetic};
use light4gs_tests::hostile::configurations::{ends, tiny_with};
use light4gs_tests::hostile::{train, without_panic};
use light4gs_train::config::{Config, KEYS, Key};
use light4gs_train::error::TrainError;

/// Values to use instead of the last one: a large value that trains quickly where the end of the range would use the
/// whole machine, and a part together with the parts that it needs.
const INSTEAD: [(&str, &str); 10] = [
    ("data.resolution", "64"),
    ("data.initial_points", "3000"),
    ("model.hexplane.channels", "48"),
    ("model.hexplane.resolution", "[64, 64, 64, 32]"),
    ("model.hexplane.multipliers", "[1, 2, 3, 4, 5, 6]"),
    ("model.deformation.width", "512"),
    ("model.deformation.depth", "20"),
    ("train.batch_size", "40"),
    ("compression.context.fit_iterations", "30"),
    ("compression.context.parts", "['hyperprior', 'inter_scale', 'high_scale_hyperprior']"),
];

/// Values to use in place of the ends of a range, where no two ends make a legal list.
const PAIRS: [(&str, [&str; 2]); 1] = [("data.between", ["[0.0, 1.0]", "[0.2, 0.8]"])];

/// Keys and their values.
type Overrides = &'static [(&'static str, &'static str)];

/// Other keys that must be set where a value is not legal, or has no effect, alone. A name that ends in a dot is that of a
/// table: every key in it.
const COMPANIONS: [(&str, &str, Overrides); 18] = [
    ("train.coarse_iterations", "0", &[("train.fine_iterations", "3")]),
    ("train.fine_iterations", "0", &[("train.prune.iterations", "[]"), ("train.coarse_iterations", "3")]),
    (
        "train.densify.adaptive.from",
        "",
        &[("train.densify.adaptive.until", "9223372036854775807"), ("train.prune.fraction", "0.0")],
    ),
    ("train.densify.adaptive.until", "", &[("train.prune.fraction", "0.0")]),
    ("train.densify.adaptive.until", "0", &[("train.densify.adaptive.from", "0")]),
    ("train.prune.iterations", "[1]", &[("train.densify.adaptive.until", "0")]),
    ("train.prune.iterations", "[100000000]", &[("train.fine_iterations", "100000000")]),
    (
        "train.corrections.",
        "",
        &[("train.exposure", "\"frame\""), ("train.poses", "\"frame\""), ("train.corrections.from", "0")],
    ),
    ("train.guided_sampling.", "", &[("model.field", "\"nodes\""), ("model.nodes.lifetime", "true")]),
    ("train.guided_sampling.count", "", &[("train.guided_sampling.iterations", "[2]")]),
    ("train.guided_sampling.lifetime", "", &[("train.guided_sampling.iterations", "[2]")]),
    ("train.guided_sampling.iterations", "[100000000]", &[("train.fine_iterations", "100000000")]),
    ("compression.rate.from", "", &[("compression.rate.planes_until", "0")]),
    ("eval.views", "0", &[("eval.interval", "0")]),
    ("compression.context.fit_iterations", "", &[("compression.rate.lambda", "0.0")]),
    ("model.nodes.", "", &[("model.field", "\"nodes\"")]),
    ("train.widening_window.", "", &[("train.sampling", "\"widening_window\"")]),
    ("model.sh_degree", "", &[("train.sh_degree_interval", "1")]),
];

fn scene(folder: &Path) {
    let options = SyntheticOptions { resolution: 16, train_frames: 4, test_frames: 1, val_frames: 0, seed: 0 };
    write_synthetic(folder, &options).unwrap();
}

#[test]
fn every_legal_value_of_every_key_trains_and_is_encoded() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("scene");
    scene(&data);
    let mut failures = Vec::new();
    let mut count = 0;
    for Key { path: key, bounds, .. } in KEYS.iter() {
        let mut values = ends(bounds);
        if let Some((_, instead)) = INSTEAD.iter().find(|(other, _)| *other == key.as_str()) {
            *values.last_mut().unwrap() = (*instead).to_owned();
        }
        if let Some((_, pairs)) = PAIRS.iter().find(|(other, _)| *other == key.as_str()) {
            values = pairs.map(str::to_owned).to_vec();
        }
        for value in values {
            let is_meant = |name: &str| if name.ends_with('.') { key.starts_with(name) } else { name == key.as_str() };
            let companions =
                COMPANIONS.iter().filter(|(name, at, _)| is_meant(name) && (at.is_empty() || *at == value));
            let mut pairs: Vec<(&str, &str)> = companions.flat_map(|(_, _, pairs)| *pairs).copied().collect();
            pairs.push((key, &value));
            let text = tiny_with(&pairs);
            let config = Config::from_toml(&text, key).unwrap_or_else(|error| panic!("{key} = {value}: {error}"));
            count += 1;
            match without_panic(&format!("{key} = {value}"), || train(&config, &data, 4)) {
                // Training may fail with an extreme rate, as long as it says so.
                Ok(()) | Err(TrainError::Diverged(_)) => {}
                Err(error) => failures.push(format!("{key} = {value}: {error}")),
            }
        }
    }
    println!("{count} configurations");
    assert!(failures.is_empty(), "{} of {count} failed:\n{}", failures.len(), failures.join("\n"));
}
