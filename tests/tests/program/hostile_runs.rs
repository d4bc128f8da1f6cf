//! Hundreds of damaged checkpoints, configurations, run folders and datasets. Each is refused with the file and the
//! field named, or accepted; none causes a panic. `LIGHT4GS_HOSTILE_CASES=5000` makes this a long run.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::PROGRAM;
use burn::tensor::Device;
use light4gs_data::{ImageStore, Scene, SyntheticOptions, write_synthetic};
use light4gs_tests::hostile::checkpoints::{self, Parts};
use light4gs_tests::hostile::configurations::{is_cheap, odd, tiny_with};
use light4gs_tests::hostile::{assert_bearable, bytes, cases, generator, json, run_within, train, without_panic};
use light4gs_tests::program::{TINY_COMPRESSION, Workspace, assert_refused, assert_success};
use light4gs_train::Stage;
use light4gs_train::compression::ConfiguredModels;
use light4gs_train::config::Config;
use light4gs_train::dataset::load_options;
use light4gs_train::density::{AdaptiveDensityControl, DensityStrategy};
use light4gs_train::error::TrainError;
use light4gs_train::loss::LossInput;
use light4gs_train::run::{Checkpoint, RunFolder};
use light4gs_train::trainer::Trainer;
use rand::Rng;
use rand::seq::IndexedRandom;

fn scene(folder: &Path) -> PathBuf {
    let path = folder.join("scene");
    let options = SyntheticOptions { resolution: 16, train_frames: 4, test_frames: 2, val_frames: 1, seed: 0 };
    write_synthetic(&path, &options).unwrap();
    path
}

/// A tiny run with all parts, trained in this process: its configuration and its newest checkpoint.
fn checkpoint(folder: &Path) -> (Config, PathBuf) {
    let config = Config::from_toml(&tiny_with(&[]), "tiny").unwrap();
    let scene = scene(folder);
    let run = RunFolder::create(&folder.join("run"), Some(&scene), &config, false).unwrap();
    let data = Scene::open(&scene, &load_options(&config)).unwrap();
    let mut trainer = Trainer::builder(config.clone(), data).run_folder(run.clone()).build().unwrap();
    while trainer.step().unwrap().is_some() {}
    let path = run.last_checkpoint().unwrap();
    (config, path)
}

/// As in `resume`, the density strategy restores its state.
fn load(path: &Path, config: &Config) -> Result<Checkpoint, TrainError> {
    let checkpoint: Checkpoint =
        Checkpoint::load(path, config, &config.model.build(), &ConfiguredModels, &Device::flex().autodiff())?;
    let mut density = AdaptiveDensityControl::new(config.train.densify.strategies.adaptive.clone());
    density
        .restore(checkpoint.density.clone(), checkpoint.scene.gaussians.len())
        .map_err(|problem| TrainError::Checkpoint { path: path.to_owned(), problem })?;
    Ok(checkpoint)
}

#[test]
fn damaged_checkpoints_are_refused_with_the_tensor() {
    let folder = tempfile::tempdir().unwrap();
    let (config, whole) = checkpoint(folder.path());
    load(&whole, &config).unwrap();
    let bytes = fs::read(&whole).unwrap();
    let parts = Parts::of(&bytes);
    let path = folder.path().join("damaged.safetensors");
    fs::write(&path, parts.clone().without_checksums().to_bytes()).unwrap();
    load(&path, &config).expect("an older version's file");

    // Found once: in case 544 the means alone have a row more, and another tensor was blamed.
    for case in (0..cases(300)).chain([544]) {
        let random = &mut generator(case);
        let (damaged, what) = match random.random_range(0..5) {
            0 => bytes::mutate(&bytes, random),
            part => {
                let (damaged, what) = checkpoints::mutate(&parts, random);
                let damaged = if part > 1 { damaged.without_checksums() } else { damaged };
                (damaged.to_bytes(), what)
            }
        };
        if damaged == bytes {
            continue;
        }
        fs::write(&path, damaged).unwrap();
        let what = format!("case {case}: {what}");
        match without_panic(&what, || load(&path, &config)) {
            Ok(_) => panic!("believed: {what}"),
            Err(error) => {
                let text = error.to_string();
                assert!(matches!(error, TrainError::Checkpoint { .. }) && !error.is_internal(), "{what}: {text}");
                assert!(text.contains("damaged.safetensors"), "{what}: {text}");
                let of_a_tensor = !what.contains("metadata") && (what.contains("` has") || what.contains("` is "));
                if let Some(name) = what.split('`').nth(1).filter(|_| of_a_tensor) {
                    assert!(text.contains(name), "{what}: {text}");
                }
            }
        }
    }
}

#[test]
fn a_checkpoint_with_a_number_that_is_not_finite_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let (config, whole) = checkpoint(folder.path());
    let mut state = load(&whole, &config).unwrap();
    let adam = state.adam.states.values_mut().next().unwrap();
    adam.second = adam.second.clone() + f32::INFINITY;
    let path = folder.path().join("new.safetensors");
    let text = state.save(&path).unwrap_err().to_string();
    assert!(text.contains("second.") && text.contains("inf"), "{text}");
    assert!(!path.exists());
}

/// A loss that is not a number, or a gradient of it that is not: the run stops, says where, and leaves a checkpoint
/// from which it can continue.
#[test]
fn numbers_that_are_not_finite_stop_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let overrides = [("train.fine_iterations", "6"), ("train.checkpoint_interval", "2"), ("train.log_interval", "1")];
    let config = Config::from_toml(&tiny_with(&overrides), "tiny").unwrap();
    for (name, of_the_gradient) in [("loss", false), ("gradient", true)] {
        let run = RunFolder::create(&folder.path().join(name), Some(&scene), &config, false).unwrap();
        let data = Scene::open(&scene, &load_options(&config)).unwrap();
        let loss = move |view: LossInput| {
            let error = view.image - view.truth;
            match (view.stage == Stage::Fine && view.iteration == 4, of_the_gradient) {
                (false, _) => error.powi_scalar(2).mean(),
                (true, false) => (error * f32::NAN).mean(),
                // The square root has no finite slope at 0.
                (true, true) => (error * 0.0).sqrt().mean(),
            }
        };
        let mut trainer = Trainer::builder(config.clone(), data).run_folder(run.clone()).loss(loss).build().unwrap();
        let error = loop {
            if let Err(error) = trainer.step() {
                break error;
            }
        };
        let TrainError::Diverged(divergence) = &error else { panic!("{error}") };
        assert_eq!((divergence.stage, divergence.iteration), (Stage::Fine, 4));
        let checkpoint = divergence.checkpoint.clone().unwrap();
        assert!(checkpoint.ends_with("fine_000002.safetensors"), "{}", checkpoint.display());
        load(&checkpoint, &config).unwrap();
        let text = error.to_string();
        assert!(!error.is_internal() && text.contains("light4gs resume") && text.contains("--set train."), "{text}");
        assert_eq!(text.contains("parameter `scene."), of_the_gradient, "{text}");
    }
}

#[test]
fn odd_configurations_are_refused_or_train() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let (mut trained, mut refused, mut late) = (0, 0, Vec::new());
    for case in 0..cases(150) {
        let text = odd(&mut generator(case));
        let what = format!("case {case}:\n{text}");
        let Ok(config) = without_panic(&what, || Config::from_toml(&text, "odd")) else {
            refused += 1;
            continue;
        };
        if is_cheap(&config) {
            match without_panic(&what, || train(&config, &scene, 4)) {
                Ok(()) | Err(TrainError::Diverged(_)) => trained += 1,
                Err(error) => late.push(format!("{error}: {what}")),
            }
        }
    }
    println!("{refused} refused, {trained} trained");
    assert!(late.is_empty(), "{} refused after training:\n{}", late.len(), late.join("\n"));
    assert!(refused > 0 && trained > 0);
}

#[test]
fn damaged_run_folders_do_no_harm() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("run", &TINY_COMPRESSION).output().unwrap());
    let checkpoint = format!("checkpoints/{}", w.names("run/checkpoints").last().unwrap());
    let files = [
        "run.json",
        "config.toml",
        "dataset.json",
        "metrics.jsonl",
        "coding.json",
        "bit_maps.json",
        "eval.json",
        "scene.l4gs",
    ];
    let files: Vec<&str> = files.into_iter().chain([checkpoint.as_str()]).collect();
    let commands: [&[&str]; 3] =
        [&["eval", "run", "--device", "flex"], &["encode", "run", "--out", "x.l4gs"], &["resume", "run", "--quiet"]];
    let whole: Vec<Vec<u8>> = files.iter().map(|file| fs::read(w.path("run").join(file)).unwrap()).collect();
    for case in 0..cases(60) {
        let random = &mut generator(case);
        let at = random.random_range(0..files.len());
        let path = w.path("run").join(files[at]);
        let parsed = serde_json::from_slice(&whole[at]).ok().filter(|_| files[at].ends_with(".json"));
        let (damaged, what) = match parsed {
            Some(value) if random.random_range(0..4) > 0 => {
                let (value, what) = json::mutate(&value, random);
                (serde_json::to_vec_pretty(&value).unwrap(), what)
            }
            _ => bytes::mutate(&whole[at], random),
        };
        fs::write(&path, damaged).unwrap();
        let command = *commands.choose(random).unwrap();
        let what = format!("case {case}: `{}` with {} {what}", command.join(" "), files[at]);
        let output = run_within(&mut w.command(command.iter().copied()), Duration::from_secs(60), &what);
        assert_bearable(&output, &what);
        for (file, bytes) in files.iter().zip(&whole) {
            fs::write(w.path("run").join(file), bytes).unwrap();
        }
    }
}

#[test]
fn damaged_datasets_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let files = ["transforms_train.json", "transforms_test.json", "train/r_000.png", "test/r_000.png"];
    let whole: Vec<Vec<u8>> = files.iter().map(|file| fs::read(scene.join(file)).unwrap()).collect();
    let config = Config::from_toml(&tiny_with(&[]), "tiny").unwrap();
    let options = load_options(&config);
    for case in 0..cases(200) {
        let random = &mut generator(case);
        let at = random.random_range(0..files.len());
        let (damaged, what) = match serde_json::from_slice(&whole[at]) {
            Ok(value) if random.random_range(0..4) > 0 => {
                let (value, what) = json::mutate(&value, random);
                (serde_json::to_vec(&value).unwrap(), what)
            }
            _ => bytes::mutate(&whole[at], random),
        };
        fs::write(scene.join(files[at]), damaged).unwrap();
        let what = format!("case {case}: {} {what}", files[at]);
        without_panic(&what, || {
            let Ok(data) = Scene::open(&scene, &options) else { return };
            let images = ImageStore::new(&options, 64 << 20);
            for frame in data.train.iter().chain(&data.test) {
                if images.get(frame).is_err() {
                    return;
                }
            }
            let mut trainer = match Trainer::builder(config.clone(), data).build() {
                Ok(trainer) => trainer,
                Err(_) => return,
            };
            let _ = trainer.step();
            let _ = trainer.step();
        });
        fs::write(scene.join(files[at]), &whole[at]).unwrap();
    }
}

/// Inputs that were found by hand, each tested again.
#[test]
fn found_before() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("run", &TINY_COMPRESSION).output().unwrap());

    // A pipe as a configuration: reading it waited for its other end.
    #[cfg(unix)]
    {
        let pipe = w.path("pipe.toml");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let mut command = w.command(["train", "scene", "--config", "pipe.toml", "--out", "x"]);
        assert_refused(&run_within(&mut command, Duration::from_secs(10), "a pipe"), &["pipe.toml", "regular file"]);
        // The same with a pipe in the place of a stream or of a point cloud; and a pipe to write to was replaced by a
        // file.
        for arguments in [
            ["info", "pipe.toml", "--limits", "default"],
            ["decode", "pipe.toml", "--out", "x"],
            ["decode", "run/scene.l4gs", "--out", "pipe.toml"],
        ] {
            let output = run_within(&mut w.command(arguments), Duration::from_secs(10), "a pipe");
            assert_refused(&output, &["pipe.toml", "a pipe, a socket or a device"]);
        }
        let mut command = w.command(["import", "pipe.toml", "--from", "ply", "--out", "x.l4gs"]);
        assert_refused(&run_within(&mut command, Duration::from_secs(10), "a pipe"), &["pipe.toml", "regular file"]);
        assert!(std::os::unix::fs::FileTypeExt::is_fifo(&fs::metadata(&pipe).unwrap().file_type()));
    }
    // Outputs that replaced an input, or a part of a run.
    fs::copy(w.path("run/scene.l4gs"), w.path("copy.l4gs")).unwrap();
    let checkpoint = format!("run/checkpoints/{}", w.names("run/checkpoints").last().unwrap());
    for (arguments, words) in [
        (["decode", "copy.l4gs", "--out", "./copy.l4gs"], ["copy.l4gs", "reads this file"]),
        (["export", "copy.l4gs", "--html", "copy.l4gs"], ["copy.l4gs", "reads this file"]),
        (["encode", "run", "--out", "run/run.json"], ["run/run.json", "belongs to a run"]),
        (["decode", "copy.l4gs", "--out", "run/config.toml"], ["run/config.toml", "belongs to a run"]),
        (["decode", "copy.l4gs", "--out", checkpoint.as_str()], ["run/checkpoints", "belongs to a run"]),
    ] {
        assert_refused(&w.run(arguments), &words);
    }
    assert_eq!(fs::read(w.path("copy.l4gs")).unwrap(), fs::read(w.path("run/scene.l4gs")).unwrap());
    // The text of the file that `extends` names was quoted.
    fs::write(w.path("secret.txt"), "root:secret-password:0").unwrap();
    fs::write(w.path("curious.toml"), "extends = \"./secret.txt\"").unwrap();
    let output = w.run(["train", "scene", "--config", "curious.toml", "--out", "x"]);
    assert_refused(&output, &["secret.txt:1", "not valid TOML"]);
    assert!(!String::from_utf8_lossy(&output.stderr).contains("password"));

    // A dataset whose path is not Unicode.
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::ffi::OsStrExt;
        let name = std::ffi::OsStr::from_bytes(b"sc\xffne");
        fs::rename(w.path("scene"), w.path("").join(name)).unwrap();
        let mut command = w.command(["train"]);
        command.arg(name).args(["--config", "hexplane-dnerf-cpu", "--out", "x"]);
        assert_refused(&command.output().unwrap(), &["Unicode"]);
        fs::rename(w.path("").join(name), w.path("scene")).unwrap();
    }
    assert!(!w.path("x").exists());

    // An option may have a negative number as its value.
    assert_success(&w.run(["render", "run/scene.l4gs", "--out", "low.gif", "--frames", "2", "--elevation", "-30"]));
    assert_refused(&w.run(["render", "run/scene.l4gs", "--out", "x.gif", "--elevation", "-91"]), &["--elevation"]);
    assert_refused(&w.run(["render", "run/scene.l4gs", "--out", "x.gif", "--frames", "-3"]), &["--frames", "-3"]);
    assert_refused(&w.run(["render", "run/scene.l4gs", "--out", "x.gif", "--radius", "-1"]), &["--radius"]);

    // A map of another width.
    let path = w.path("run/bit_maps.json");
    let mut maps: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    maps[0]["width"] = 4_000_000_000u32.into();
    fs::write(&path, maps.to_string()).unwrap();
    assert_refused(&w.run(["eval", "run"]), &["bit_maps.json", "4000000000", "light4gs resume"]);
    assert_success(&w.run(["resume", "run", "--quiet"]));

    // A record that is no JSON.
    let record = fs::read_to_string(w.path("run/run.json")).unwrap();
    fs::write(w.path("run/run.json"), &record[..record.len() / 2]).unwrap();
    assert_refused(&w.run(["resume", "run"]), &["run.json is damaged", "\"scene\"", "--overwrite"]);
    fs::write(w.path("run/run.json"), record).unwrap();

    // Configurations that the encoder would refuse after the last iteration.
    for (key_value, key) in [
        ("model.hexplane.multipliers=[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17]", "model.hexplane.multipliers"),
        ("compression.attributes.steps.opacity_logits=1e-45", "compression.attributes.steps.opacity_logits"),
        ("compression.attributes.steps.opacty_logits=0.1", "the nearest is `opacity_logits`"),
        ("compression.steps.space_time=1e-45", "compression.steps.space_time"),
        ("compression.sh.step=1e300", "compression.sh.step"),
        ("data.initial_box=3e38", "data.initial_box"),
        ("train.learning_rate.attributes_init.opacity_logits=1e39", "attributes_init.opacity_logits"),
    ] {
        assert_refused(&w.train("x", &[key_value]).output().unwrap(), &[key]);
        assert!(!w.path("x").exists());
    }
    let wide = ["model.deformation.width=4096", "model.deformation.depth=64"];
    assert_refused(&w.train("x", &wide).output().unwrap(), &["model.deformation.width", "at most"]);
    assert!(!w.path("x").exists());
}

/// A finite number that no stream can hold was found only by the encoder, after the last iteration, without the
/// tensor's name.
#[test]
fn numbers_beyond_what_the_encoder_takes_are_found_in_the_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (config, whole) = checkpoint(folder.path());
    let parts = Parts::of(&fs::read(&whole).unwrap()).without_checksums();
    let path = folder.path().join("huge.safetensors");
    let of_a_gaussian =
        |at: &usize| parts.tensors[*at].0.starts_with("scene.gaussians.") && !parts.tensors[*at].3.is_empty();
    for at in (0..parts.tensors.len()).filter(of_a_gaussian) {
        let mut parts = parts.clone();
        let (name, _, _, bytes) = &mut parts.tensors[at];
        let name = name.clone();
        bytes[..4].copy_from_slice(&3e38f32.to_le_bytes());
        fs::write(&path, parts.to_bytes()).unwrap();
        let text = load(&path, &config).unwrap_err().to_string();
        assert!(text.contains("huge.safetensors") && text.contains(&name) && text.contains("3e38"), "{text}");
    }
}

/// Scenes that the encoder refuses, and cameras that no training survives, are refused before `--overwrite` removes
/// anything.
#[test]
fn a_dataset_that_cannot_be_coded_costs_no_run() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("run", &[]).output().unwrap());
    let before = w.names("run");
    let bytes = fs::read(w.path("scene/transforms_train.json")).unwrap();
    let mut frames = serde_json::from_slice::<serde_json::Value>(&bytes).unwrap()["frames"].take();
    for frame in frames.as_array_mut().unwrap() {
        let path = format!("{}.png", frame["file_path"].as_str().unwrap());
        frame["file_path"] = path.into();
    }
    for split in ["train", "test", "val"] {
        fs::remove_file(w.path(&format!("scene/transforms_{split}.json"))).unwrap();
    }
    let properties = ["x", "y", "z"].map(|axis| format!("property float {axis}\n")).concat();
    let points = |first: &str| {
        let rows: String = (0..20).map(|i| format!("{first} 0.{i} 0.2\n")).collect();
        format!("ply\nformat ascii 1.0\nelement vertex 20\n{properties}end_header\n{rows}")
    };
    let refused = |first: &str, focal: f64, x: f64, words: &[&str]| {
        let mut frames = frames.clone();
        frames[0]["transform_matrix"][0][3] = x.into();
        let (side, middle) = (32, 16.0);
        let transforms = serde_json::json!({
            "fl_x": focal, "fl_y": focal, "cx": middle, "cy": middle, "w": side, "h": side,
            "ply_file_path": "points.ply", "frames": frames,
        });
        fs::write(w.path("scene/transforms.json"), transforms.to_string()).unwrap();
        fs::write(w.path("scene/points.ply"), points(first)).unwrap();
        let mut command = w.train("run", &[]);
        assert_refused(&command.arg("--overwrite").output().unwrap(), words);
        assert_eq!(w.names("run"), before);
    };
    refused("3e38", 40.0, 1.0, &["scene", "none of 20 points"]);
    refused("0.1", 40.0, 1e20, &["transforms.json", "frames[0]", "world units"]);
    refused("0.1", 1e-30, 1.0, &["transforms.json", "focal length"]);
}

/// Found with an odd configuration: planes were frozen before the rate of the spherical harmonics began, so the rate
/// had no gradient.
#[test]
fn frozen_planes_alone_have_no_rate() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    for pairs in [("model.sh_degree", "0"), ("train.densify.adaptive.until", "1000")] {
        let text = tiny_with(&[("train.prune.fraction", "0.0"), ("train.fine_iterations", "6"), pairs]);
        train(&Config::from_toml(&text, "frozen").unwrap(), &scene, 7).unwrap();
    }
}

/// Everything that has changed since the run began is reported before anything is trained.
#[test]
fn a_dataset_that_changed_is_noticed() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("run", &[]).output().unwrap());
    let resume = |more: &[&str]| w.command(["resume", "run", "--quiet"]).args(more).output().unwrap();
    assert_success(&resume(&[]));
    let transforms = w.path("scene/transforms_train.json");
    let whole = fs::read_to_string(&transforms).unwrap();
    let edit = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = serde_json::from_str(&whole).unwrap();
        change(&mut value);
        fs::write(&transforms, serde_json::to_string(&value).unwrap()).unwrap();
    };
    let frames = |value: &mut serde_json::Value| value["frames"].as_array_mut().unwrap().clone();
    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
    let changes: [(Change, &str); 4] = [
        (&|json| drop(json["frames"].as_array_mut().unwrap().remove(2)), "removed: "),
        (&|json| json["frames"].as_array_mut().unwrap().swap(1, 5), "in another order"),
        (&|json| json["camera_angle_x"] = 0.5.into(), "intrinsics"),
        (&|json| json["frames"][3]["time"] = 0.41.into(), "times"),
    ];
    for (change, word) in changes {
        edit(change);
        assert_refused(&resume(&[]), &["scene", word, "--accept-changed-dataset"]);
    }
    edit(&|json| {
        let mut first = frames(json)[0].clone();
        first["time"] = 0.377.into();
        json["frames"].as_array_mut().unwrap().push(first);
    });
    assert_refused(&resume(&[]), &["added"]);
    fs::write(&transforms, &whole).unwrap();
    let image = w.path("scene/train/r_001.png");
    fs::copy(w.path("scene/train/r_002.png"), &image).unwrap();
    assert_refused(&resume(&[]), &["replaced", "r_001.png"]);
    // `--accept-changed-dataset` continues the run, and is not needed again.
    assert_success(&resume(&["--accept-changed-dataset"]));
    assert_success(&resume(&[]));
}

#[test]
fn a_run_that_diverges_says_so_and_goes_on_with_another_rate() {
    let w = Workspace::new(PROGRAM);
    let rate = "train.learning_rate.attributes_init.means=1000";
    let output = w.train("blank", &[rate, "train.learning_rate.attributes_final.means=1000"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("warning: ") && text.contains("empty image"), "{text}");
    assert!(text.contains("--set train.learning_rate.attributes_"), "{text}");

    // A checkpoint of a finished coarse stage, and then a rate that no float32 survives.
    assert_success(&w.train("run", &[]).output().unwrap());
    let changed = ["resume", "run", "--quiet", "--set", "train.fine_iterations=60", "--set", "train.log_interval=7"];
    assert_success(&w.run(changed));
    let config = fs::read_to_string(w.path("run/config.toml")).unwrap();
    assert!(config.contains("fine_iterations = 60") && config.contains("log_interval = 7"), "{config}");
    // The changed configuration must fit what has been trained. A change that does not fit leaves the run as it is.
    for (key_value, words) in [
        ("model.sh_degree=1", ["sh_rest", "shape"]),
        ("train.fine_iterations=50", ["iteration", "50"]),
        ("train.learning_rat=1", ["learning_rat", "learning_rate"]),
    ] {
        assert_refused(&w.run(["resume", "run", "--quiet", "--set", key_value]), &words);
        assert_eq!(fs::read_to_string(w.path("run/config.toml")).unwrap(), config);
    }
}
