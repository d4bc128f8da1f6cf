//! A run that is killed and resumed ends where an uninterrupted one ends, bit for bit.

use std::fs;
use std::time::Duration;

use crate::PROGRAM;
use light4gs_tests::program::{TINY_COMPRESSION, Workspace, assert_success};

#[test]
fn killed_and_resumed_runs_are_bit_identical() {
    killed_and_resumed(&TINY_COMPRESSION);
}

/// Nodes are made when motion begins, at most one a Gaussian. A survey finds the ways of objects, and unseen knots are
/// continued.
#[test]
fn killed_and_resumed_runs_of_control_nodes_are_bit_identical() {
    let nodes = [
        "model.field=nodes",
        "train.sampling=widening_window",
        "train.widening_window.times=3",
        "train.widening_window.survey=0.3",
    ];
    killed_and_resumed(&TINY_COMPRESSION.into_iter().chain(nodes).collect::<Vec<&str>>());
}

/// Exposures and poses of frames are in checkpoints, with what Adam knows of them.
#[test]
fn killed_and_resumed_runs_with_corrections_are_bit_identical() {
    let corrections = ["train.exposure=frame", "train.poses=frame", "train.corrections.from=3"];
    killed_and_resumed(&TINY_COMPRESSION.into_iter().chain(corrections).collect::<Vec<&str>>());
}

fn killed_and_resumed(settings: &[&str]) {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("whole", settings).output().unwrap());
    let expected = fs::read(w.path("whole/scene.l4gs")).unwrap();

    // SIGKILL after a growing delay: in the first iterations, between checkpoints, in the fine stage.
    let mut child = w.train("killed", settings).spawn().unwrap();
    let mut kills = 0;
    for attempt in 1..60 {
        let delay = Duration::from_millis(40 * attempt);
        std::thread::sleep(delay);
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success());
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        if w.path("killed/run.json").exists() {
            child = w.command(["resume", "killed", "--quiet"]).spawn().unwrap();
        } else {
            // Killed before there was a run: the user would start it again.
            let _ = fs::remove_dir_all(w.path("killed"));
            child = w.train("killed", settings).spawn().unwrap();
        }
    }
    assert!(child.wait().unwrap().success());
    assert!(kills > 0, "the run was never interrupted");
    assert_eq!(fs::read(w.path("killed/scene.l4gs")).unwrap(), expected, "after {kills} kills");
}

#[test]
fn a_seed_repeats_and_threads_do_not_matter() {
    let w = Workspace::new(PROGRAM);
    for views in ["train.batch_size=1", "train.batch_size=3", "model.field=nodes"] {
        let settings: Vec<&str> = TINY_COMPRESSION.into_iter().chain([views]).collect();
        let files = ["1", "2", "3"].map(|threads| {
            let run = format!("{views}-{threads}");
            assert_success(&w.train(&run, &settings).env("RAYON_NUM_THREADS", threads).output().unwrap());
            fs::read(w.path(&run).join("scene.l4gs")).unwrap()
        });
        assert!(files.iter().all(|file| *file == files[0]), "{views}");
    }
}

/// A checkpoint holds plain numbers, so a run can be resumed on another back end than the one that wrote it. Nothing is compressed:
/// that a GPU can do so is another test's, which takes a minute to compile the kernels of the entropy models.
#[test]
fn a_run_changes_its_back_end() {
    let w = Workspace::new(PROGRAM);
    for (first, second) in [("ndarray", "wgpu"), ("wgpu", "flex")] {
        let settings = ["train.fine_iterations=100000", "compression.profile=float32"];
        let mut child = w.train(first, &settings).args(["--device", first]).spawn().unwrap();
        let checkpoints = format!("{first}/checkpoints");
        while w.names(&checkpoints).iter().all(|name| !name.ends_with(".safetensors")) {
            assert!(child.try_wait().unwrap().is_none(), "the run ended without a checkpoint");
            std::thread::sleep(Duration::from_millis(1));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        // The rest of the run need not be as long.
        let config = w.path(first).join("config.toml");
        let text = fs::read_to_string(&config).unwrap();
        assert!(text.contains("fine_iterations = 100000"));
        fs::write(&config, text.replace("fine_iterations = 100000", "fine_iterations = 100")).unwrap();
        assert_success(&w.run(["resume", first, "--quiet", "--device", second]));
        let evaluation = fs::read_to_string(w.path(first).join("eval.json")).unwrap();
        assert!(evaluation.contains(second), "{evaluation}");
    }
}
