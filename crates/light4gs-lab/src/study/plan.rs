//! From a study to its runs: variants x scenes x seeds.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use light4gs_data::DataError;
use light4gs_train::config::{Config, Overrides};
use light4gs_train::error::TrainError;

use super::definition::{Axis, DEFAULT_CONFIG, Output, Study, schedule_problem};

/// In the name of a configuration, it stands for the name of the scene.
const SCENE_PLACE: &str = "{scene}";

/// The options of a study.
#[derive(Clone, Debug, Default)]
pub struct PlanOptions {
    /// The preset or file that every variant starts from, in place of the values' own; `{scene}` in it stands for the scene's name.
    pub config: Option<String>,
    /// Folders of the datasets.
    pub scenes: Vec<PathBuf>,
    /// Length of the schedule of every run, divided by the configuration's; see [`SCHEDULES`](super::definition::SCHEDULES).
    pub schedule: Option<f64>,
    /// Overrides of every run.
    pub overrides: Vec<String>,
    /// Number of runs of each variant on each scene, each with a seed of its own. At least 1.
    pub seeds: u64,
    /// Names of the trainings that the program has in addition, which values of an axis may ask for.
    pub trainings: Vec<String>,
    /// Folders of other studies, whose trainings are reused.
    pub reuse: Vec<PathBuf>,
    /// The command that asks for the study, for its record; empty if there is none.
    pub command: String,
}

/// One combination of the axes' values.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The values' names, joined by `+`: a folder.
    pub name: String,
    /// The values' labels.
    pub label: String,
    /// Index of the value of each axis.
    pub values: Vec<usize>,
}

/// A dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyScene {
    /// Name of its folder, which is a folder of the study.
    pub name: String,
    /// Absolute path.
    pub path: PathBuf,
}

/// One run.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    /// `SCENE/VARIANT/seed-K`: its folder below the study's.
    pub name: String,
    /// Index of the scene.
    pub scene: usize,
    /// Index of the variant.
    pub variant: usize,
    /// Counted from 0.
    pub seed: u64,
    /// The complete configuration.
    pub config: Config,
    /// Name of the program's own training, if it is one.
    pub training: Option<String>,
    /// Runs of one task differ only in how the file is written. They are trained once, by the first of them.
    pub task: usize,
}

/// All runs of a study.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The definition of the study.
    pub study: Study,
    /// In the order of the tables' rows.
    pub variants: Vec<Variant>,
    /// In the order given.
    pub scenes: Vec<StudyScene>,
    /// Runs of each variant on each scene.
    pub seeds: u64,
    /// Scene by scene, seed by seed, variant by variant.
    pub runs: Vec<PlannedRun>,
    /// Absolute paths of other studies, whose trainings are reused.
    pub reuse: Vec<PathBuf>,
    /// The command that asks for the study, for its record.
    pub command: String,
}

impl Plan {
    /// The runs of a study. Every configuration is made and checked; datasets are not opened.
    ///
    /// # Errors
    /// [`TrainError::Input`] with the variant whose configuration is wrong, for two variants or scenes that would be the
    /// same, and for options out of range; [`TrainError::Data`] for a folder that does not exist.
    pub fn new(study: Study, options: &PlanOptions) -> Result<Self, TrainError> {
        if options.seeds == 0 {
            return Err(TrainError::Input("--seeds is 0; at least one run of each variant is needed".into()));
        }
        if let Some(problem) = options.schedule.and_then(schedule_problem) {
            return Err(TrainError::Input(format!("--schedule {problem}")));
        }
        let variants = variants(&study.axis);
        check_reference(&study, &variants)?;
        let trainings = variants
            .iter()
            .map(|variant| training_of(&study, variant, &options.trainings))
            .collect::<Result<Vec<_>, _>>()?;
        let scenes = scenes(&options.scenes)?;
        let mut runs: Vec<PlannedRun> = Vec::new();
        let mut tasks = 0;
        for (scene_index, scene) in scenes.iter().enumerate() {
            let configs = variants
                .iter()
                .map(|variant| config_of(&study, variant, &scene.name, options))
                .collect::<Result<Vec<_>, _>>()?;
            check_different(&variants, &configs, &trainings)?;
            for seed in 0..options.seeds {
                let first = runs.len();
                for (variant_index, (variant, config)) in variants.iter().zip(&configs).enumerate() {
                    let mut config = config.clone();
                    config.seed = config.seed.saturating_add(seed);
                    config.validate()?;
                    let training = trainings[variant_index].clone();
                    let alike =
                        |earlier: &&PlannedRun| earlier.training == training && earlier.config.trains_like(&config);
                    let like = runs[first..].iter().find(alike);
                    let task = like.map_or(tasks, |earlier| earlier.task);
                    tasks = tasks.max(task + 1);
                    let name = format!("{}/{}/seed-{seed}", scene.name, variant.name);
                    let (scene, variant) = (scene_index, variant_index);
                    runs.push(PlannedRun { name, scene, variant, seed, config, training, task });
                }
            }
        }
        let absolute = |path: &PathBuf| std::fs::canonicalize(path).map_err(DataError::io("read", path));
        let reuse = options.reuse.iter().map(absolute).collect::<Result<Vec<_>, _>>()?;
        let command = options.command.clone();
        Ok(Self { study, variants, scenes, seeds: options.seeds, runs, reuse, command })
    }

    /// Number of tasks.
    pub fn tasks(&self) -> usize {
        self.runs.iter().map(|run| run.task + 1).max().unwrap_or(0)
    }
}

/// All combinations of the axes' values; the last axis varies fastest.
pub fn variants(axes: &[Axis]) -> Vec<Variant> {
    let mut indices = vec![Vec::new()];
    for axis in axes {
        let longer = |before: &Vec<usize>| {
            let before = before.clone();
            (0..axis.value.len()).map(move |value| before.iter().copied().chain([value]).collect::<Vec<_>>())
        };
        indices = indices.iter().flat_map(longer).collect();
    }
    let variant = |values: Vec<usize>| {
        let chosen: Vec<_> = axes.iter().zip(&values).map(|(axis, value)| &axis.value[*value]).collect();
        let name = chosen.iter().map(|value| value.name.as_str()).collect::<Vec<_>>().join("+");
        let label = chosen.iter().map(|value| value.label()).collect::<Vec<_>>().join(", ");
        Variant { name, label, values }
    };
    indices.into_iter().map(variant).collect()
}

fn check_reference(study: &Study, variants: &[Variant]) -> Result<(), TrainError> {
    match &study.reference {
        Some(reference) if !variants.iter().any(|variant| variant.name == *reference) => {
            let names = variants.iter().map(|variant| variant.name.as_str()).collect::<Vec<_>>().join(", ");
            Err(TrainError::Input(format!(
                "study \"{}\": `reference` is \"{reference}\", which is no variant; it must be one of {names}",
                study.title
            )))
        }
        _ => Ok(()),
    }
}

fn config_of(study: &Study, variant: &Variant, scene: &str, options: &PlanOptions) -> Result<Config, TrainError> {
    let chosen = || study.axis.iter().zip(&variant.values).map(|(axis, value)| &axis.value[*value]);
    let own = chosen().find_map(|value| value.config.as_ref());
    let base = own.or(options.config.as_ref()).or(study.config.as_ref()).map_or(DEFAULT_CONFIG, String::as_str);
    let mut names = vec![base.replace(SCENE_PLACE, scene)];
    names.extend(study.presets.iter().cloned());
    names.extend(chosen().flat_map(|value| value.presets.iter().cloned()));
    let names = names.join("+");
    let factor: Option<f64> = chosen().filter_map(|value| value.schedule).chain(options.schedule).reduce(|a, b| a * b);
    let own: Vec<String> = chosen().flat_map(|value| &value.set).chain(&options.overrides).cloned().collect();
    let scaled = |factor| {
        let longer = Config::load(&names, &[])?.for_schedule(factor, &Overrides::default());
        longer.with(&Overrides::parse(&own)?)
    };
    factor
        .map_or_else(|| Config::load(&names, &own), scaled)
        .map_err(|error| TrainError::Input(format!("variant \"{}\" of \"{}\": {error}", variant.name, study.title)))
}

/// The training that a variant's values ask for, which must be one of the program's.
fn training_of(study: &Study, variant: &Variant, known: &[String]) -> Result<Option<String>, TrainError> {
    let refuse = |problem: String| {
        Err(TrainError::Input(format!("variant \"{}\" of \"{}\": {problem}", variant.name, study.title)))
    };
    let values = study.axis.iter().zip(&variant.values).map(|(axis, value)| &axis.value[*value]);
    let asked: Vec<&String> = values.filter_map(|value| value.training.as_ref()).collect();
    let training = match asked[..] {
        [] => return Ok(None),
        [training] => training,
        _ => return refuse("two of its values ask for a `training`; only one can be made".to_owned()),
    };
    if !known.contains(training) {
        let has = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        return refuse(format!(
            "`training` is \"{training}\", of which this program has {has}; run the study by the program that adds it \
             (docs/studies.md, \"With a part of your own\")"
        ));
    }
    if study.shows(Output::Primitives) {
        return refuse(
            "the output \"primitives\" draws built-in fields only; take it from `outputs`, or `training` away"
                .to_owned(),
        );
    }
    Ok(Some(training.clone()))
}

/// Refuses variants that an override has made equal, since nothing would vary between them.
fn check_different(variants: &[Variant], configs: &[Config], trainings: &[Option<String>]) -> Result<(), TrainError> {
    for (later, wanted) in configs.iter().zip(trainings).enumerate() {
        if let Some(earlier) = configs.iter().zip(trainings).take(later).position(|earlier| earlier == wanted) {
            return Err(TrainError::Input(format!(
                "variants \"{}\" and \"{}\" have the same configuration: nothing would vary between them. Leave out the \
                 --set that makes them alike, or change their values in the study",
                variants[earlier].name, variants[later].name
            )));
        }
    }
    Ok(())
}

fn scenes(paths: &[PathBuf]) -> Result<Vec<StudyScene>, TrainError> {
    if paths.is_empty() {
        return Err(TrainError::Input("no scene is given; name the folder of at least one dataset".into()));
    }
    let mut names = BTreeSet::new();
    let scene = |path: &PathBuf| {
        let path = std::fs::canonicalize(path).map_err(DataError::io("read", path))?;
        let name = scene_name(&path)?;
        if !names.insert(name.clone()) {
            return Err(TrainError::Input(format!(
                "two scenes are called {name}, the second at {}; their runs would share folders. Study them apart",
                path.display()
            )));
        }
        Ok(StudyScene { name, path })
    };
    paths.iter().map(scene).collect()
}

fn scene_name(path: &Path) -> Result<String, TrainError> {
    let name = path.file_name().and_then(|name| name.to_str());
    // Names that begin with a point are reserved for the study's own files.
    name.filter(|name| path.to_str().is_some() && !name.starts_with('.')).map(str::to_owned).ok_or_else(|| {
        TrainError::Input(format!(
            "{} has no name that a folder of the study could have (in Unicode, no point in front); rename it",
            path.display()
        ))
    })
}

#[cfg(test)]
mod tests {
    use light4gs_model::FieldKind;

    use super::*;

    fn study(axes: &str) -> Study {
        Study::from_toml(&format!("title = \"t\"\nreproduces = \"-\"\noutputs = [\"table\"]\n{axes}"), "test").unwrap()
    }

    const LAMBDAS: &str = r#"
[[axis]]
name = "lambda"
value = [
    { name = "none", set = ["compression.rate.lambda=0"] },
    { name = "none-float32", set = ["compression.rate.lambda=0", "compression.profile=float32"] },
    { name = "strong", set = ["compression.rate.lambda=0.05"] },
]
"#;
    const DEGREES: &str = r#"
[[axis]]
name = "degree"
value = [{ name = "three", label = "degree 3" }, { name = "one", set = ["model.sh_degree=1"] }]
"#;

    fn options(scene: &Path) -> PlanOptions {
        PlanOptions {
            config: Some("hexplane-dnerf-cpu".into()),
            scenes: vec![scene.into()],
            schedule: None,
            overrides: Vec::new(),
            seeds: 1,
            trainings: vec!["mine".to_owned()],
            reuse: Vec::new(),
            command: String::new(),
        }
    }

    #[test]
    fn runs_are_the_product() {
        let folder = tempfile::tempdir().unwrap();
        let scenes: Vec<PathBuf> = ["one", "two"].iter().map(|name| folder.path().join(name)).collect();
        scenes.iter().for_each(|scene| std::fs::create_dir(scene).unwrap());
        let options = PlanOptions { scenes, seeds: 3, ..options(folder.path()) };
        let plan = Plan::new(study(&format!("{DEGREES}{LAMBDAS}")), &options).unwrap();
        assert_eq!(plan.variants.len(), 6);
        assert_eq!(plan.variants[4].name, "one+none-float32");
        assert_eq!(plan.variants[1].label, "degree 3, none-float32");
        assert_eq!(plan.runs.len(), 2 * 3 * 6);
        // The two without rate differ only in how the file is written.
        assert_eq!(plan.tasks(), 2 * 3 * 4);
        let tasks: Vec<_> = plan.runs[..6].iter().map(|run| run.task).collect();
        assert_eq!(tasks, [0, 0, 1, 2, 2, 3]);
        assert_eq!(plan.runs[6].name, "one/three+none/seed-1");
        assert_eq!(plan.runs[6].config.seed, 1);
        let digests: BTreeSet<_> = plan.runs[..18].iter().map(|run| run.config.digest()).collect();
        assert_eq!(digests.len(), 18);
    }

    /// The factors of the command and of a value are multiplied, and what is set by hand wins.
    /// A row of the paper's system stays the paper's, whatever the other rows start from.
    #[test]
    fn a_value_starts_from_its_own_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene");
        std::fs::create_dir(&scene).unwrap();
        let axes = r#"
[[axis]]
name = "system"
value = [{ name = "paper", config = "paper-dnerf" }, { name = "other" }]
"#;
        let fields = |config: Option<&str>, study: &Study| {
            let options = PlanOptions { config: config.map(str::to_owned), ..options(&scene) };
            let plan = Plan::new(study.clone(), &options).unwrap();
            plan.runs.iter().map(|run| run.config.model.field).collect::<Vec<_>>()
        };
        let (planes, nodes) = (FieldKind::HexPlane, FieldKind::Nodes);
        assert_eq!(fields(Some("dnerf"), &study(axes)), [planes, nodes]);
        assert_eq!(fields(None, &study(axes)), [planes, planes]);
        let own = study(&format!("config = \"dnerf\"\n{axes}"));
        assert_eq!(fields(None, &own), [planes, nodes]);
        assert_eq!(fields(Some("hexplane-dnerf"), &own), [planes, planes]);
    }

    #[test]
    fn a_schedule_can_be_longer_or_shorter() {
        let folder = tempfile::tempdir().unwrap();
        let axes = LAMBDAS.replace("name = \"strong\"", "name = \"strong\", schedule = 0.5");
        let scene = folder.path().join("scene");
        std::fs::create_dir(&scene).unwrap();
        let overrides = vec!["train.coarse_iterations=7".to_owned()];
        let options = PlanOptions { schedule: Some(0.1), overrides, ..options(&scene) };
        let plan = Plan::new(study(&axes), &options).unwrap();
        let usual = Config::load("hexplane-dnerf-cpu", &[]).unwrap().train.fine_iterations;
        let fine = |run: usize| plan.runs[run].config.train.fine_iterations;
        assert_eq!([fine(0), fine(2)], [usual / 10, usual / 20]);
        assert!(plan.runs.iter().all(|run| run.config.train.coarse_iterations == 7));
        let error = Plan::new(study(&axes), &PlanOptions { schedule: Some(-1.0), ..options }).unwrap_err().to_string();
        assert!(error.contains("--schedule is -1"), "{error}");
    }

    const TRAININGS: &str = r#"
[[axis]]
name = "field"
value = [{ name = "usual" }, { name = "own", training = "mine" }]
"#;

    /// The same configuration twice, trained in two ways: two tasks.
    #[test]
    fn a_training_of_the_programs_own_is_a_task_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene");
        std::fs::create_dir(&scene).unwrap();
        let plan = Plan::new(study(TRAININGS), &options(&scene)).unwrap();
        assert_eq!(plan.tasks(), 2);
        let trainings: Vec<_> = plan.runs.iter().map(|run| run.training.as_deref()).collect();
        assert_eq!(trainings, [None, Some("mine")]);
    }

    #[test]
    fn what_cannot_be_run_is_refused_before_it_begins() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene");
        std::fs::create_dir(&scene).unwrap();
        let refused = |study: Study, options: PlanOptions, words: &[&str]| {
            let error = Plan::new(study, &options).unwrap_err().to_string();
            words.iter().for_each(|word| assert!(error.contains(word), "`{word}` is not in: {error}"));
        };
        let good = options(&scene);
        refused(study(LAMBDAS), PlanOptions { seeds: 0, ..good.clone() }, &["--seeds"]);
        let none = PlanOptions { trainings: Vec::new(), ..good.clone() };
        refused(study(TRAININGS), none, &["\"own\"", "`training` is \"mine\"", "has none"]);
        let twice = format!("{TRAININGS}{}", TRAININGS.replace("\"field\"", "\"other\""));
        refused(study(&twice), good.clone(), &["own+own", "two of its values"]);
        refused(study(LAMBDAS), PlanOptions { scenes: vec![], ..good.clone() }, &["scene"]);
        refused(study(LAMBDAS), PlanOptions { scenes: vec![folder.path().join("no")], ..good.clone() }, &["no"]);
        refused(study(LAMBDAS), PlanOptions { scenes: vec![scene.clone(); 2], ..good.clone() }, &["two scenes"]);
        let alike = vec!["compression.rate.lambda=0.1".to_owned()];
        refused(study(LAMBDAS), PlanOptions { overrides: alike, ..good.clone() }, &["none", "strong", "--set"]);
        let wrong = study(&LAMBDAS.replace("lambda=0.05", "lambda=-1"));
        refused(wrong, good.clone(), &["strong", "compression.rate.lambda", "must be 0 to"]);
        refused(study(&LAMBDAS.replace("rate.lambda=0.05", "rate.lamda=0.05")), good.clone(), &["strong", "lambda"]);
        refused(study(&format!("reference = \"weak\"\n{LAMBDAS}")), good.clone(), &["weak", "one of none"]);
        refused(
            study(LAMBDAS),
            PlanOptions { config: Some("hexplane-dnerf-{scene}".into()), ..good },
            &["dnerf-scene"],
        );
    }

    #[test]
    fn every_study_of_the_program_has_a_plan() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("flag");
        std::fs::create_dir(&scene).unwrap();
        for name in super::super::catalog::NAMES {
            for config in [Some("hexplane-dnerf-{scene}-cpu"), Some("hexplane-dnerf-{scene}"), None] {
                let options = PlanOptions { config: config.map(str::to_owned), ..options(&scene) };
                let plan = Plan::new(Study::load(name).unwrap(), &options).unwrap_or_else(|e| panic!("{name}: {e}"));
                assert!(!plan.runs.is_empty(), "{name}");
            }
        }
    }
}
