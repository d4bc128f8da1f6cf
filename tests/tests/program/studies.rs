//! `light4gs study`: plans, runs, tables, interruptions.

use std::fs;
use std::process::{Command, Output};

use crate::PROGRAM;
use light4gs_tests::program::{TINY, TINY_COMPRESSION, Workspace, assert_refused, assert_success};
use serde_json::Value;

/// `study NAME scene` with runs that take seconds, written into `study` unless another folder is given.
fn study(w: &Workspace, name: &str, more: &[&str]) -> Command {
    let mut command = w.command(["study", name, "scene", "--quiet", "--device", "flex"]);
    // Keys that the study varies must not be overridden.
    let varied = ["compression.rate.lambda", "train.prune.fraction"];
    for key_value in TINY.iter().chain(&TINY_COMPRESSION).filter(|set| !varied.iter().any(|key| set.starts_with(key))) {
        command.args(["--set", key_value]);
    }
    if !more.contains(&"--out") {
        command.args(["--out", "study"]);
    }
    command.args(more);
    command
}

fn run(mut command: Command) -> Output {
    command.output().expect("the program starts")
}

fn json(w: &Workspace, path: &str) -> Value {
    serde_json::from_slice(&fs::read(w.path(path)).unwrap()).unwrap()
}

/// The program under test adds `nothing-moves`. One configuration gives two runs: one of the configured field, and one of a field
/// that stands still, which the same command does not train again.
#[test]
fn a_training_that_another_crate_adds_is_a_row_of_the_table() {
    let w = Workspace::new(PROGRAM);
    let text = r#"
title = "Does it move?"
reproduces = "nothing"
outputs = ["table"]
columns = ["psnr", "bytes"]
[[axis]]
name = "field"
value = [{ name = "configured" }, { name = "still", training = "nothing-moves" }]
"#;
    fs::write(w.path("moves.toml"), text).unwrap();
    fs::write(w.path("unknown.toml"), text.replace("nothing-moves", "all-moves")).unwrap();
    let refused = run(study(&w, "unknown.toml", &[]));
    assert_refused(&refused, &["\"still\"", "`training` is \"all-moves\"", "nothing-moves"]);
    assert!(!w.path("study").exists());

    assert_success(&run(study(&w, "moves.toml", &[])));
    let planes = |variant: &str| {
        let evaluation = json(&w, &format!("study/scene/{variant}/seed-0/eval.json"));
        let sections = evaluation["sections"].as_array().unwrap();
        let planes = sections.iter().find(|section| section["name"] == "feature_planes").unwrap();
        planes["bytes"].as_u64().unwrap()
    };
    let bytes = [planes("configured"), planes("still")];
    assert!(bytes[0] > 100 && bytes[1] < 10, "{bytes:?}");
    let table = fs::read_to_string(w.path("study/table.md")).unwrap();
    assert!(table.contains("| configured |") && table.contains("| still |"), "{table}");

    let log = || fs::read(w.path("study/scene/still/seed-0/metrics.jsonl")).unwrap();
    let before = log();
    assert_success(&run(study(&w, "moves.toml", &[])));
    assert_eq!(before, log());
}

#[test]
fn a_study_from_plan_to_table() {
    let w = Workspace::new(PROGRAM);
    let plan = run(study(&w, "sizes", &["--dry-run"]));
    assert_success(&plan);
    let text = String::from_utf8(plan.stdout).unwrap();
    for words in
        ["scene/float32/seed-0", "scene/paper-profile/seed-0", "trained above", "5 runs in 4 tasks, 240 iterations"]
    {
        assert!(text.contains(words), "{text}");
    }
    assert!(!w.path("study").exists(), "a dry run writes nothing");

    let first = run(study(&w, "sizes", &["--json"]));
    assert_success(&first);
    let results: Value = serde_json::from_slice(&first.stdout).unwrap();
    assert_eq!(results["runs"].as_array().unwrap().len(), 5);
    assert_eq!(results["missing"], Value::Array(Vec::new()));
    let table = fs::read_to_string(w.path("study/table.md")).unwrap();
    assert!(table.contains("| moving dB | still dB |"), "the scene has masks: {table}");
    for row in ["float32", "medium, paper's profile", "high", "medium", "small"] {
        assert!(table.contains(&format!("| {row} |")), "{table}");
    }
    // The medium size is not trained again for the paper's profile: the times in the log are the same to the
    // microsecond.
    let log = |variant: &str| fs::read(w.path(&format!("study/scene/{variant}/seed-0/metrics.jsonl"))).unwrap();
    assert_eq!(log("paper-profile"), log("medium"));
    assert_ne!(log("medium"), log("small"));
    // The manifest has the digest of each configuration, the same as in the run's folder.
    let manifest = json(&w, "study/study.json");
    let results = json(&w, "study/results.json");
    assert_eq!(manifest["runs"][1]["configuration"], results["runs"][1]["configuration"]);
    let csv = fs::read_to_string(w.path("study/results.csv")).unwrap();
    assert_eq!(csv.lines().count(), 6);
    assert!(csv.starts_with("scene,size,seed,psnr,ssim,") && !csv.contains("minutes"), "{csv}");
    assert!(fs::read_to_string(w.path("study/times.csv")).unwrap().starts_with("scene,size,seed,minutes"));
    // The record is what pages are generated from.
    let record = json(&w, "study/record.json");
    assert!(record["command"].as_str().unwrap().contains("light4gs-under-test study sizes "), "{}", record["command"]);
    assert_eq!((&record["rows"][2]["size"], &record["seeds"]), (&"medium".into(), &serde_json::json!([0])));
    assert_eq!(record["rows"][2]["bytes"].as_f64(), results["runs"][2]["bytes"].as_f64());
    assert_ne!((&record["machine"], &record["date"]), (&"unknown".into(), &"unknown".into()));

    // Finished runs are not repeated, nor measured again.
    let before = fs::metadata(w.path("study/scene/small/seed-0/eval.json")).unwrap().modified().unwrap();
    assert_success(&run(study(&w, "sizes", &[])));
    let after = fs::metadata(w.path("study/scene/small/seed-0/eval.json")).unwrap().modified().unwrap();
    assert_eq!(before, after);
    assert_eq!(fs::read_to_string(w.path("study/table.md")).unwrap(), table);
    assert_success(&w.run(["gather", "study"]));
    assert_eq!(fs::read_to_string(w.path("study/table.md")).unwrap(), table);

    // A run that was lost is trained again, to the same bytes. Until then the tables name it as missing.
    let lost = w.path("study/scene/small/seed-0");
    let bytes = fs::read(lost.join("scene.l4gs")).unwrap();
    fs::remove_dir_all(&lost).unwrap();
    assert_refused(&w.run(["gather", "study"]), &["scene/small/seed-0", "not begun", "1 of 5"]);
    assert!(fs::read_to_string(w.path("study/table.md")).unwrap().contains("small (0 of 1 runs)"));
    assert_success(&run(study(&w, "sizes", &["--jobs", "2"])));
    assert_eq!(fs::read(lost.join("scene.l4gs")).unwrap(), bytes);
    assert_eq!(fs::read_to_string(w.path("study/table.md")).unwrap(), table);

    // Another study uses the runs that this one has trained, and says so; its files come from its own training.
    let command = |more: &[&str]| study(&w, "latency", &[&["--out", "other", "--reuse", "study"], more].concat());
    let plan = String::from_utf8(run(command(&["--dry-run"])).stdout).unwrap();
    assert!(plan.contains("reused") && plan.contains("4 runs in 4 tasks, 0 iterations"), "{plan}");
    assert_success(&run(command(&[])));
    let other = |name: &str| fs::read(w.path(&format!("other/scene/small/seed-0/{name}"))).unwrap();
    assert_eq!(other("metrics.jsonl"), log("small"));
    assert_eq!(other("scene.l4gs"), bytes);
    let record = |run: &str| json(&w, &format!("{run}/scene/small/seed-0/run.json"));
    assert_eq!(record("other")["trained_by"], record("study"));
    // It does not use runs of a dataset with other contents, even where the path is the same.
    fs::remove_dir_all(w.path("other/scene/small")).unwrap();
    let image = fs::read_dir(w.path("scene/test")).unwrap().next().unwrap().unwrap().path();
    let (original, replacement) = (fs::read(&image).unwrap(), fs::read(w.path("scene/train/r_000.png")).unwrap());
    fs::write(&image, replacement).unwrap();
    assert_success(&run(command(&[])));
    assert_ne!(other("metrics.jsonl"), log("small"));
    assert_eq!(record("other")["trained_by"], Value::Null);
    fs::write(&image, original).unwrap();
    assert_refused(&run(study(&w, "latency", &["--out", "third", "--reuse", "scene"])), &["scene", "not the folder"]);

    // Another configuration in the same folders is refused.
    let output = run(study(&w, "sizes", &["--set", "compression.sh.step=0.1"]));
    assert_refused(&output, &["another configuration", "scene/float32/seed-0"]);
}

const MINE: &str = r#"
title = "Degrees"
reproduces = "nothing"
reference = "one"
outputs = ["table", "curves", "composition", "bit_maps", "plane_values", "latency", "primitives"]
columns = ["psnr", "psnr:difference", "bytes:percent", "gaussians"]

[[axis]]
name = "degree"
value = [
    { name = "one", set = ["model.sh_degree=1"] },
    { name = "two", set = ["model.sh_degree=2"] },
]

[curves]
along = "degree"
"#;

#[test]
fn seeds_give_a_spread_and_failures_do_not_stop_others() {
    let w = Workspace::new(PROGRAM);
    fs::write(w.path("mine.toml"), MINE).unwrap();
    let seeds = [
        "--seeds",
        "3",
        "--jobs",
        "3",
        "--set",
        "train.fine_iterations=20",
        "--set",
        "train.densify.adaptive.until=15",
        "--set",
        "compression.rate.planes_until=0",
    ];
    // A folder in which no run can be created.
    fs::create_dir_all(w.path("study/.configurations")).unwrap();
    fs::create_dir_all(w.path("study/scene/two/seed-1")).unwrap();
    fs::write(w.path("study/scene/two/seed-1/notes.txt"), "mine").unwrap();
    let output = run(study(&w, "mine.toml", &seeds));
    assert_refused(&output, &["scene/two/seed-1", "notes.txt", "1 of 6"]);
    let table = fs::read_to_string(w.path("study/table.md")).unwrap();
    assert!(table.contains("two (2 of 3 runs)") && table.contains(" ± "), "{table}");
    assert!(table.contains("notes.txt"), "the table says why: {table}");

    fs::remove_file(w.path("study/scene/two/seed-1/notes.txt")).unwrap();
    assert_success(&run(study(&w, "mine.toml", &seeds)));
    let results = json(&w, "study/results.json");
    let files: std::collections::BTreeSet<_> =
        (0..3).map(|seed| fs::read(w.path(&format!("study/scene/one/seed-{seed}/scene.l4gs"))).unwrap()).collect();
    assert_eq!(files.len(), 3, "seeds differ");
    let cell = &results["tables"][0]["rows"][1]["cells"][1];
    assert!(cell["deviation"].as_f64().unwrap() > 0.0 && cell["within_spread"].is_boolean(), "{cell}");
}

#[test]
fn what_is_wrong_is_said_before_anything_is_written() {
    let w = Workspace::new(PROGRAM);
    let refused = |name: &str, more: &[&str], words: &[&str]| {
        assert_refused(&run(study(&w, name, more)), words);
        assert!(!w.path("study").exists());
    };
    refused("context", &[], &["context", "nearest is `context-model`", ".toml"]);
    refused("latenzy", &[], &["nearest is `latency`"]);
    refused("no.toml", &[], &["no.toml"]);
    refused("sizes", &["--set", "train.fine_iteration=1"], &["train.fine_iteration", "train.fine_iterations"]);
    refused("sizes", &["--slurm", "cluster.toml"], &["--launcher slurm"]);
    refused("context-model", &["--set", "compression.context.parts=[]"], &["all", "no-inter-plane", "--set"]);
    fs::write(w.path("broken.toml"), MINE.replace("psnr:difference", "psnr:diff")).unwrap();
    refused("broken.toml", &[], &["broken.toml:6", "psnr:diff", "`:percent`", "docs/studies.md"]);
    assert_refused(&w.run(["gather", "scene"]), &["scene", "not the folder of a study"]);
    assert_refused(&w.run(["study", "sizes", "nowhere", "--out", "study"]), &["nowhere"]);
    // The study does not write into a folder that holds other files.
    let output = w.run(["study", "sizes", "scene", "--out", "scene"]);
    assert_refused(&output, &["holds files but no study"]);
    assert_success(&w.run(["study", "list"]));
}

#[cfg(unix)]
mod interrupted {
    use std::thread::sleep;
    use std::time::Duration;

    use super::*;

    fn signal(process: u32, name: &str) {
        assert!(Command::new("kill").args([name, &process.to_string()]).status().unwrap().success());
    }

    fn wait_for(what: impl Fn() -> bool) {
        for _ in 0..3000 {
            if what() {
                return;
            }
            sleep(Duration::from_millis(20));
        }
        panic!("waited for a minute");
    }

    #[test]
    fn a_stopped_run_resumes_to_the_same_bytes() {
        let w = Workspace::new(PROGRAM);
        let long = ["train.fine_iterations=200", "train.log_interval=1", "train.checkpoint_interval=1000"];
        let overrides: Vec<&str> = TINY_COMPRESSION.iter().chain(&long).copied().collect();
        assert_success(&w.train("whole", &overrides).output().unwrap());
        let log = w.path("run/metrics.jsonl");
        let lines = || fs::read_to_string(&log).map_or(0, |text| text.lines().count());
        let mut process = w.train("run", &overrides).spawn().unwrap();
        wait_for(|| lines() > 30);
        signal(process.id(), "-USR1");
        assert_eq!(process.wait().unwrap().code(), Some(75));
        let stopped_at = lines();
        assert!(stopped_at < 212 && !w.path("run/scene.l4gs").exists());
        assert_eq!(w.names("run/checkpoints").len(), 2, "that of the coarse stage's end, and that of the request");
        // Killed once more, while it resumes.
        let mut process = w.command(["resume", "run", "--quiet"]).spawn().unwrap();
        wait_for(|| lines() > stopped_at + 20);
        signal(process.id(), "-USR1");
        assert_eq!(process.wait().unwrap().code(), Some(75));
        assert_success(&w.run(["resume", "run", "--quiet"]));
        for name in ["scene.l4gs", "bit_maps.json", "config.toml"] {
            assert_eq!(
                fs::read(w.path("run").join(name)).unwrap(),
                fs::read(w.path("whole").join(name)).unwrap(),
                "{name}"
            );
        }
    }

    #[test]
    fn a_stopped_or_killed_study_goes_on_to_the_same_bytes() {
        let w = Workspace::new(PROGRAM);
        fs::write(w.path("mine.toml"), MINE).unwrap();
        let longer = ["--set", "train.log_interval=1", "--seeds", "2", "--jobs", "2"];
        let files = || {
            let run = |name: &str| fs::read(w.path(&format!("study/scene/{name}/scene.l4gs"))).unwrap();
            ["one/seed-0", "one/seed-1", "two/seed-0", "two/seed-1"].map(run)
        };
        assert_success(&run(study(&w, "mine.toml", &longer)));
        let (expected, table) = (files(), fs::read_to_string(w.path("study/table.md")).unwrap());
        fs::remove_dir_all(w.path("study")).unwrap();

        for name in ["-USR1", "-KILL"] {
            let mut process = study(&w, "mine.toml", &longer).spawn().unwrap();
            let log = w.path("study/scene/one/seed-0/metrics.jsonl");
            wait_for(|| fs::read_to_string(&log).is_ok_and(|text| text.lines().count() > 14));
            signal(process.id(), name);
            let status = process.wait().unwrap();
            assert_eq!(status.code(), (name == "-USR1").then_some(75), "{status}");
            assert!(!w.path("study/table.md").exists());
            if name == "-USR1" {
                fs::remove_dir_all(w.path("study/scene/one")).unwrap();
            }
        }
        // Tasks of the killed launcher may still run: this waits for them.
        assert_success(&run(study(&w, "mine.toml", &longer)));
        assert!(files() == expected);
        assert_eq!(fs::read_to_string(w.path("study/table.md")).unwrap(), table);
    }
}
