use std::fs;

use super::layering::{layers, schema};
use super::*;

fn problem_text(result: Result<Config, ConfigError>) -> String {
    result.expect_err("must be refused").to_string()
}

/// A folder with one file.
fn folder_with(name: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join(name), text).expect("writing a file");
    folder
}

#[test]
fn every_preset_loads_and_survives_a_round_trip() {
    for name in preset_names() {
        let config = Config::from_preset(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        let text = config.to_toml();
        let back = Config::from_toml(&text, "round trip").unwrap_or_else(|error| panic!("{name}: {error}\n{text}"));
        assert_eq!(config, back, "{name}");
        assert_eq!(text, back.to_toml(), "{name}");
        assert_eq!(config.digest(), back.digest(), "{name}");
    }
}

#[test]
fn a_layout_without_a_preset_is_named() {
    use light4gs_data::{DataError, DatasetLayout, LoadOptions, Scene};
    struct Own;
    impl DatasetLayout for Own {
        fn name(&self) -> &'static str {
            "own"
        }

        fn signature(&self) -> &'static str {
            "own.txt"
        }

        fn detect(&self, _: &Path) -> bool {
            false
        }

        fn open(&self, root: &Path, _: &LoadOptions) -> Result<Scene, DataError> {
            Err(DataError::field(root, "own", "found", "nothing"))
        }
    }
    let text = Config::preset_of(&Own).unwrap_err().to_string();
    assert!(text.contains("layout `own`") && text.contains("dnerf"), "{text}");
}

/// Set, the test of what follows from the declarations of keys writes it instead of comparing it.
const WRITE: &str = "LIGHT4GS_WRITE_KEYS";

/// Compares a part of a file of the repository with what follows from the declarations.
fn follows(path: &str, begin: &str, end: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    let text = fs::read_to_string(&path).expect("reading a file of the repository");
    let (above, rest) = text.split_once(begin).unwrap_or_else(|| panic!("{} lacks: {begin}", path.display()));
    let below = rest.find(end).map_or("", |place| &rest[place..]);
    let whole = format!("{above}{begin}{expected}{below}");
    if std::env::var_os(WRITE).is_some() {
        fs::write(&path, whole).expect("writing a file of the repository");
    } else {
        let stale = text.lines().zip(whole.lines()).find(|(found, expected)| found != expected);
        assert!(
            text == whole,
            "{} is not what the declarations of keys say, from {stale:?} on: run this test with {WRITE}=1, which writes it",
            path.display()
        );
    }
}

#[test]
fn the_tables_of_keys_follow_from_the_declarations() {
    let (begin, end) = ("<!-- keys -->\n", "<!-- end of keys -->");
    follows("docs/configuration.md", begin, end, &keys_as_markdown());
}

#[test]
fn every_layout_has_a_preset() {
    use light4gs_data::Layouts;
    let layouts = Layouts::default();
    for name in layouts.names() {
        let layout = layouts.by_name(name).expect("a known layout");
        let preset = Config::preset_of(layout).unwrap_or_else(|error| panic!("{error}"));
        let config = Config::load(preset, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(
            config.data.layout.is_none_or(|layout| layout == name),
            "the preset {preset} is for another layout than {name}"
        );
    }
}

#[test]
fn base_is_the_default() {
    assert_eq!(Config::from_preset("base").expect("base"), Config::default());
}

/// Every key that is written is declared, and with bounds that fit the type of its value.
#[test]
fn every_key_has_bounds_of_its_type() {
    fn fits(bounds: &Bounds, value: &toml::Value) -> bool {
        match (bounds, value) {
            (Bounds::Flag, toml::Value::Boolean(_)) => true,
            (Bounds::Whole { .. } | Bounds::WholeOrNone { .. }, toml::Value::Integer(_)) => true,
            (Bounds::Number { .. }, toml::Value::Float(_)) => true,
            (Bounds::List { element, .. }, toml::Value::Array(values)) => {
                values.iter().all(|value| fits(element, value))
            }
            (Bounds::ByName(each), toml::Value::Table(values)) => values.values().all(|value| fits(each, value)),
            (
                Bounds::Text | Bounds::Name(_) | Bounds::Parsed { .. } | Bounds::NameOrNone { .. },
                toml::Value::String(_),
            ) => true,
            _ => false,
        }
    }
    let mut written = schema::defaults();
    for Key { path, bounds, .. } in KEYS.iter() {
        let names: Vec<&str> = path.split('.').collect();
        let (last, tables) = names.split_last().expect("a key has a name");
        let table = tables.iter().fold(&mut written, |table, name| table[*name].as_table_mut().expect("a table"));
        let value = table.remove(*last).unwrap_or_else(|| panic!("{path} is not written"));
        assert!(fits(bounds, &value), "{path}: {bounds:?}");
    }
    fn count(table: &toml::Table) -> usize {
        table.values().map(|value| value.as_table().map_or(1, count)).sum()
    }
    assert_eq!(count(&written), 0, "not declared: {written:?}");
}

#[test]
fn numbers_that_float32_cannot_hold_are_refused() {
    for value in ["1e39", "3e38", "1e-45", "nan", "inf", "-1.0"] {
        let number: f64 = value.parse().expect("a number");
        for Key { path, bounds, .. } in KEYS.iter() {
            // A range that includes 0 has small numbers in it.
            if matches!(bounds, Bounds::Number { least, most } if !(*least..=*most).contains(&number)) {
                let text = problem_text(Config::from_toml(&format!("{path} = {value}"), "text"));
                assert!(text.contains(path), "{path} = {value}: {text}");
            }
        }
    }
}

/// One number stands as float32 there and as float64 here.
#[test]
fn the_step_of_spherical_harmonics_is_that_of_the_models() {
    use light4gs_model::{ShAutoregressiveConfig, ShBottleneckConfig, ShHexPlaneCoupledConfig, ShMixtureConfig};
    let steps = [
        ShBottleneckConfig::new().step,
        ShMixtureConfig::new().step,
        ShAutoregressiveConfig::new().step,
        ShHexPlaneCoupledConfig::new(8).step,
    ];
    assert_eq!(steps, [Config::default().compression.sh.entropy.step as f32; 4]);
}

#[test]
fn an_unknown_key_is_named_with_file_line_and_nearest_key() {
    let folder = folder_with("mine.toml", "extends = \"dnerf\"\n\n[train.densify.adaptive]\nintervall = 50\n");
    let path = folder.path().join("mine.toml");
    assert_eq!(
        problem_text(Config::from_file(&path)),
        format!(
            "{}:4: unknown key `train.densify.adaptive.intervall`; the nearest known key is `train.densify.adaptive.interval`",
            path.display()
        )
    );
}

#[test]
fn an_unknown_key_below_is_laid_to_the_file_that_has_it() {
    let folder = folder_with("below.toml", "[trian]\nbatch_size = 2\n");
    fs::write(folder.path().join("top.toml"), "extends = \"below.toml\"").expect("writing a file");
    let text = problem_text(Config::from_file(folder.path().join("top.toml")));
    assert!(text.contains("below.toml:1: unknown key `trian`; the nearest known key is `train`"), "{text}");
}

#[test]
fn a_key_in_the_wrong_table_finds_its_home() {
    let text = problem_text(Config::from_toml("fine_iterations = 3", "text"));
    assert_eq!(text, "text: unknown key `fine_iterations`; the nearest known key is `train.fine_iterations`");
}

#[test]
fn wrong_types_name_key_and_line() {
    let folder = folder_with("mine.toml", "[data]\nbackground = [1, 1, \"white\"]\n");
    let text = problem_text(Config::from_file(folder.path().join("mine.toml")));
    assert!(text.contains("mine.toml:2: `data.background` must be an array"), "{text}");
    for (bad, key) in [
        ("train.batch_size = -1", "train.batch_size"),
        ("train.batch_size = 1.5", "train.batch_size"),
        ("train = 3", "train"),
        ("model.sh_degree = true", "model.sh_degree"),
        ("compression.attributes.steps = 3", "compression.attributes.steps"),
        ("compression.attributes.steps.age = '3'", "compression.attributes.steps.age"),
        ("compression.attributes.steps.age = { first = 3 }", "compression.attributes.steps.age"),
    ] {
        let text = problem_text(Config::from_toml(bad, "text"));
        assert!(text.starts_with(&format!("text: `{key}` must be ")), "{text}");
    }
    for bad in ["model.sh_degree = 300", "model.hexplane.resolution = [1, 2, 3]", "data.background = [1, 1, 1, 1]"] {
        let text = problem_text(Config::from_toml(bad, "text"));
        assert!(text.starts_with("text: ") && text.contains('`'), "{text}");
    }
}

#[test]
fn extends_in_a_circle_is_refused() {
    let folder = folder_with("a.toml", "extends = \"b.toml\"");
    fs::write(folder.path().join("b.toml"), "extends = \"./a.toml\"").expect("writing a file");
    let error = Config::from_file(folder.path().join("a.toml")).expect_err("a circle");
    assert!(matches!(&error, ConfigError::Cycle { chain } if chain.len() == 3), "{error:?}");
    let folder = folder_with("self.toml", "extends = \"self.toml\"");
    let error = Config::from_file(folder.path().join("self.toml")).expect_err("a circle");
    assert!(matches!(&error, ConfigError::Cycle { chain } if chain.len() == 2), "{error:?}");
}

#[test]
fn tables_merge_deeply_and_the_top_wins() {
    let folder = folder_with("mine.toml", "extends = \"hexplane-dnerf-cpu\"\n[model.hexplane]\nmultipliers = [1]\n");
    let mine = Config::from_file(folder.path().join("mine.toml")).expect("a configuration");
    let small = Config::from_preset("hexplane-dnerf-cpu").expect("a preset");
    assert_eq!(mine.model.fields.hexplane.hexplane.multipliers, [1]);
    assert_eq!(mine.model.fields.hexplane.hexplane.channels, small.model.fields.hexplane.hexplane.channels);
    assert_eq!(mine.train, small.train);
}

/// The folders of a study's runs are named after variants and schedules, such as `preset+quarter`.
#[test]
fn a_path_may_have_the_sign_that_joins_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = folder.path().join("preset+quarter");
    fs::create_dir(&run).expect("making a folder");
    fs::write(run.join("a+b.toml"), "extends = \"hexplane-dnerf-cpu\"\nseed = 7\n").expect("writing a file");
    fs::write(run.join("pixels.toml"), "[data]\nresolution = 64\n").expect("writing a file");
    let [base, pixels] = ["a+b.toml", "pixels.toml"].map(|name| run.join(name).display().to_string());
    let config = Config::load(&base, &[]).expect("a configuration");
    assert_eq!(config.seed, 7);
    let config = Config::load(&format!("{base}+medium+{pixels}"), &[]).expect("a configuration");
    let expected = Config::load("hexplane-dnerf-cpu+medium", &["seed=7", "data.resolution=64"].map(str::to_owned));
    assert_eq!(config, expected.expect("a configuration"));
    assert_eq!(layers::split("a++b+"), ["a", "", "b", ""]);
    let missing = run.join("missing.toml").display().to_string();
    let text = problem_text(Config::load(&missing, &[]));
    assert!(text.starts_with(&missing), "{text}");
}

#[test]
fn overrides_come_last() {
    let overrides = ["train.fine_iterations=200", "device = flex", "data.resolution=0", "eval.splits=[\"val\"]"];
    let config = Config::load("hexplane-dnerf-cpu", &overrides.map(str::to_owned)).expect("a configuration");
    assert_eq!(config.train.fine_iterations, 200);
    assert_eq!(config.device, DeviceName::Flex);
    assert_eq!(config.data.resolution, None);
    assert_eq!(config.eval.splits, [EvalSplit::Val]);
    for device in ["ndarray", "wgpu", "wgpu:0", "wgpu:discrete", "wgpu:cpu"] {
        let config = Config::load("hexplane-dnerf-cpu", &[format!("device={device}")]).expect("a configuration");
        assert_eq!(config.device.to_string(), device);
    }
    for (bad, part) in [
        ("train.fine_iteration=200", "the nearest known key is `train.fine_iterations`"),
        ("train.fine_iterations", "expected key=value"),
        ("train.fine_iterations=", "not valid TOML"),
        ("train.fine_iterations=many", "must be a whole number"),
        ("extends=dnerf", "belongs in a file"),
        ("seed=1\nseed=2", "one line"),
        ("=1", "not valid TOML"),
        ("device=fleks", "the nearest is `flex`"),
    ] {
        let text = problem_text(Config::load("dnerf", &[bad.to_owned()]));
        assert!(text.starts_with("override `") && text.contains(part), "{text}");
    }
}

#[test]
fn an_unknown_choice_is_named_with_its_key_and_the_nearest_one() {
    for (bad, key, nearest) in [
        ("compression.profile = 'papper'", "compression.profile", "paper"),
        ("compression.rate.weighting = 'megabyte'", "compression.rate.weighting", "megabytes"),
        ("compression.context.architecture = 'compcat'", "compression.context.architecture", "compact"),
        ("compression.sh.model = 'factorised'", "compression.sh.model", "factorized"),
        ("train.loss = 'fotometric'", "train.loss", "photometric"),
        ("train.sampling = 'shufled'", "train.sampling", "shuffled"),
        ("train.densify.strategy = 'adaptiv'", "train.densify.strategy", "adaptive"),
        ("train.prune.score = 'sensitivty'", "train.prune.score", "sensitivity"),
        ("train.prune.volume = 'clampd'", "train.prune.volume", "clamped"),
        ("eval.splits = ['tset']", "eval.splits", "test"),
        ("device = 'flax'", "device", "flex"),
    ] {
        let text = problem_text(Config::from_toml(bad, "text"));
        assert!(text.contains(&format!("`{key}`")) && text.contains(&format!("nearest is `{nearest}`")), "{text}");
    }
    let text = problem_text(Config::from_toml("data.layout = 'dnref'", "text"));
    assert!(text.contains("`data.layout` is `dnref`, and the nearest layout is `dnerf`"), "{text}");
}

#[test]
fn density_strategies_are_checked_with_the_rest() {
    // Where none is to come, pruning may begin at once; where some are, they come first.
    let overrides = ["train.densify.strategy=none", "train.prune.fraction=0.1", "train.prune.iterations=[5]"];
    let text = format!("extends = 'hexplane-dnerf-cpu'\n{}", overrides.join("\n").replace("=none", "='none'"));
    Config::from_toml(&text, "text").expect("a configuration");
    let text = problem_text(Config::from_toml(&text.replace("'none'", "'adaptive'"), "text"));
    assert!(text.contains("pruning follows densification, which ends at 3500"), "{text}");
}

#[test]
fn unknown_presets_and_missing_files_are_named() {
    let text = problem_text(Config::load("dnerf-cp", &[]));
    assert!(text.contains("\"dnerf-cp\"") && text.contains("the nearest preset is \"dnerf\""), "{text}");
    let text = problem_text(Config::load("nowhere/mine.toml", &[]));
    assert!(text.starts_with("nowhere/mine.toml: cannot read the configuration"), "{text}");
    let folder = folder_with("mine.toml", "extends = \"dnref\"");
    let text = problem_text(Config::from_file(folder.path().join("mine.toml")));
    assert!(text.contains("mine.toml)") && text.contains("\"dnerf\""), "{text}");
}

#[test]
fn plane_sizes_must_be_multiples_of_four() {
    for (resolution, nearest) in [
        ("[64, 64, 64, 25]", "25 along t; it must be a multiple of 4, the nearest is 24"),
        ("[62, 64, 64, 24]", "62 along x; it must be a multiple of 4, the nearest is 60 or 64"),
        ("[64, 0, 64, 24]", "0 along y; it must be a multiple of 4, the nearest is 4"),
        ("[64, 64, 3, 24]", "3 along z; it must be a multiple of 4, the nearest is 4"),
    ] {
        let text = problem_text(Config::from_toml(&format!("model.hexplane.resolution = {resolution}"), "text"));
        assert!(text.contains("`model.hexplane.resolution`") && text.contains(nearest), "{text}");
    }
    for multipliers in ["[]", "[0, 1]", "[2, 1]", "[1, 1]", "[1, 9223372036854775807]"] {
        problem_text(Config::from_toml(&format!("model.hexplane.multipliers = {multipliers}"), "text"));
    }
}

#[test]
fn all_ranges_are_reported_at_once() {
    let bad = "[train]\nbatch_size = 0\n[train.photometric]\nlambda_dssim = 1.5\n[train.learning_rate.attributes_init]\n\
               means = nan\nopacity_logits = 0\nlifetime = 1e4\n[train.densify.adaptive]\nfrom = 9\nuntil = 8\n";
    let Err(ConfigError::Invalid { problems }) = Config::from_toml(bad, "text") else { panic!("must be refused") };
    let keys: Vec<&str> = problems.iter().map(|problem| problem.key.as_str()).collect();
    let expected = [
        "train.batch_size",
        "train.photometric.lambda_dssim",
        "train.learning_rate.attributes_init.lifetime",
        "train.learning_rate.attributes_init.means",
        "train.learning_rate.attributes_init.opacity_logits",
        "train.densify.adaptive.from",
    ];
    assert_eq!(keys, expected);
}
