//! SIGKILL at any point: every folder can be resumed or begun again and ends with the same bytes, and no temporary file
//! stays.
//!
//! `LIGHT4GS_KILLS=100` makes a hundred kills, spread over a run; a short run makes a few.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::PROGRAM;
use light4gs_data::is_temporary_name;
use light4gs_tests::program::{TINY_COMPRESSION, Workspace, assert_refused, assert_success};

fn kills(short: u32) -> u32 {
    std::env::var("LIGHT4GS_KILLS").map_or(short, |text| text.parse().expect("LIGHT4GS_KILLS is a number"))
}

fn quietly(mut command: Command) -> Command {
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Lets a command run for some time, then kills it.
fn kill_after(command: Command, delay: Duration) {
    let mut child = quietly(command).spawn().unwrap();
    std::thread::sleep(delay);
    let _ = child.kill();
    child.wait().unwrap();
}

/// Names of temporary files below a folder.
fn leftovers(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if is_temporary_name(&name) {
            found.push(name);
        } else if entry.path().is_dir() {
            found.extend(leftovers(&entry.path()));
        }
    }
    found
}

fn train(w: &Workspace, run: &str, more: &[&str]) -> Command {
    let mut command = w.train(run, &TINY_COMPRESSION);
    command.args(["--device", "flex"]).args(more);
    command
}

#[test]
fn a_run_that_is_killed_anywhere_ends_with_the_same_bytes() {
    let w = Workspace::new(PROGRAM);
    let begin = Instant::now();
    assert_success(&train(&w, "whole", &[]).output().unwrap());
    let whole = begin.elapsed();
    let expected = fs::read(w.path("whole/scene.l4gs")).unwrap();
    assert_success(&train(&w, "old", &["--set", "seed=7"]).output().unwrap());

    let points = kills(8);
    let (mut resumed, mut begun_again) = (0, 0);
    for point in 0..points {
        // From the first millisecond to a little before the end.
        let delay = Duration::from_millis(1) + whole.mul_f64(f64::from(point) / f64::from(points));
        let run = format!("killed-{point}");
        // Every third run replaces an existing one.
        let overwrite: &[&str] = if point % 3 == 2 { &["--overwrite"] } else { &[] };
        if !overwrite.is_empty() {
            copy_folder(&w.path("old"), &w.path(&run));
        }
        kill_after(train(&w, &run, overwrite), delay);

        let seed =
            |run: &str| fs::read_to_string(w.path(run).join("config.toml")).is_ok_and(|text| text.contains("seed = 0"));
        let output = if w.path(&run).join("run.json").exists() && seed(&run) {
            resumed += 1;
            w.run(["resume", &run, "--quiet"])
        } else {
            begun_again += 1;
            train(&w, &run, overwrite).output().unwrap()
        };
        assert!(output.status.success(), "killed after {delay:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(fs::read(w.path(&run).join("scene.l4gs")).unwrap(), expected, "killed after {delay:?}");
        assert_eq!(leftovers(&w.path(&run)), Vec::<String>::new(), "killed after {delay:?}");
        fs::remove_dir_all(w.path(&run)).unwrap();
    }
    println!("{points} kills over {whole:?}: {resumed} resumed, {begun_again} begun again, the same bytes each time");
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy_folder(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

#[test]
fn a_dataset_whose_making_is_killed_is_made_again() {
    let w = Workspace::new(PROGRAM);
    let synth = || w.command(["synth", "made", "--resolution", "64", "--train-frames", "30"]);
    for delay in [1, 10, 40, 80, 160] {
        kill_after(synth(), Duration::from_millis(delay));
        let _ = fs::remove_dir_all(w.path("made"));
    }
    assert_success(&synth().output().unwrap());
    assert_eq!(leftovers(&w.path("")), Vec::<String>::new());
}

/// Two processes in one folder would overwrite each other's files.
#[test]
fn one_process_a_run_folder() {
    let w = Workspace::new(PROGRAM);
    let mut first = quietly(train(&w, "run", &["--set", "train.fine_iterations=1000000"])).spawn().unwrap();
    let began = Instant::now();
    while w.names("run/checkpoints").iter().all(|name| !name.ends_with(".safetensors")) {
        assert!(first.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    }
    let holder = format!("process {}", first.id());
    assert_refused(&w.run(["resume", "run"]), &["run is in use by", &holder]);
    assert_refused(&train(&w, "run", &["--overwrite"]).output().unwrap(), &["in use", &holder]);
    assert_refused(&w.run(["encode", "run", "--out", "run/x.l4gs"]), &["in use", &holder]);
    // Reading is allowed.
    assert_success(&w.run(["encode", "run", "--out", "x.l4gs"]));
    first.kill().unwrap();
    first.wait().unwrap();
    // The lock was released when its process ended.
    let shorter = ["resume", "run", "--quiet", "--set", "train.fine_iterations=1000000"];
    let mut second = quietly(w.command(shorter)).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(second.try_wait().unwrap().is_none(), "it trains");
    second.kill().unwrap();
    second.wait().unwrap();
}

/// States that a kill can leave, constructed by hand.
#[test]
fn starts_that_were_stopped_are_begun_again() {
    let w = Workspace::new(PROGRAM);
    assert_success(&train(&w, "whole", &[]).output().unwrap());
    let expected = fs::read(w.path("whole/scene.l4gs")).unwrap();
    let config = fs::read(w.path("whole/config.toml")).unwrap();

    // Killed between `config.toml` and `run.json`, with temporary files of the killed process: once with this version's
    // lock file, once without.
    for (run, locked) in [("locked", true), ("unlocked", false)] {
        let root = w.path(run);
        fs::create_dir_all(root.join("checkpoints")).unwrap();
        fs::write(root.join("config.toml"), &config).unwrap();
        for left in [".light4gs-4711-0.part", ".light4gs-4711-1.tmp", ".run.json.4711.part"] {
            fs::write(root.join(left), "half").unwrap();
        }
        if locked {
            fs::write(root.join(".light4gs-lock"), "process 4711\n").unwrap();
        }
        assert_refused(&w.run(["resume", run]), &["run.json", "light4gs train"]);
        assert_success(&train(&w, run, &[]).output().unwrap());
        assert_eq!(fs::read(root.join("scene.l4gs")).unwrap(), expected);
        let hidden: Vec<_> = w.names(run).into_iter().filter(|name| name.starts_with('.')).collect();
        assert_eq!(hidden, [".light4gs-lock"], "leftovers are swept");
    }
    // A finished run whose record is gone: only --overwrite touches it.
    fs::remove_file(w.path("whole/run.json")).unwrap();
    assert_refused(&w.run(["resume", "whole"]), &["run.json", "--overwrite"]);
    assert_refused(&train(&w, "whole", &[]).output().unwrap(), &["--overwrite"]);
    assert_eq!(fs::read(w.path("whole/scene.l4gs")).unwrap(), expected);
    assert_success(&train(&w, "whole", &["--overwrite"]).output().unwrap());
    // A configuration that the user wrote must not be replaced.
    fs::create_dir(w.path("mine")).unwrap();
    fs::write(w.path("mine/config.toml"), "extends = \"hexplane-dnerf-cpu\"\n").unwrap();
    assert_refused(&train(&w, "mine", &["--overwrite"]).output().unwrap(), &["mine", "config.toml"]);
    assert_eq!(w.names("mine"), ["config.toml"]);
}
