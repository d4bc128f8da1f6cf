//! The program on real files: the whole pipeline, and the message for each kind of wrong input.

use std::fs;

use crate::{PROGRAM, trained};
use light4gs_model::DynamicScene;
use light4gs_tests::golden::devices;
use light4gs_tests::program::{TINY_COMPRESSION, Workspace, assert_refused, assert_success};

#[test]
fn a_scene_goes_all_the_way() {
    let w = trained();
    let expected = ["checkpoints", "config.toml", "eval.json", "metrics.jsonl", "renders", "report.html"];
    for name in expected.iter().chain(&["run.json", "scene.l4gs"]) {
        assert!(w.names("run").contains(&name.to_string()), "{name} is missing: {:?}", w.names("run"));
    }

    let eval: serde_json::Value = serde_json::from_slice(&w.run(["eval", "run", "--json"]).stdout).unwrap();
    let size = fs::metadata(w.path("run/scene.l4gs")).unwrap().len();
    assert_eq!(eval["bytes"], size, "the reported size is the file's");
    let sections: u64 = eval["sections"].as_array().unwrap().iter().map(|s| s["bytes"].as_u64().unwrap()).sum();
    assert_eq!(sections, size, "sections add up to the file");
    assert_eq!(eval["splits"].as_array().unwrap().len(), 2);
    assert!(eval["splits"][0]["psnr"].as_f64().unwrap() > 5.0);

    assert_success(&w.run(["encode", "run", "--out", "again.l4gs"]));
    assert_eq!(fs::read(w.path("again.l4gs")).unwrap(), fs::read(w.path("run/scene.l4gs")).unwrap());
    let info: serde_json::Value = serde_json::from_slice(&w.run(["info", "again.l4gs", "--json"]).stdout).unwrap();
    assert_eq!(info["bytes"], size);
    assert_success(&w.run(["eval", "again.l4gs", "--scene", "scene", "--device", "flex"]));
    assert_success(&w.run(["decode", "again.l4gs", "--out", "plain.safetensors"]));
    assert_success(&w.run(["render", "again.l4gs", "--out", "orbit.gif", "--frames", "4"]));
    assert_success(&w.run([
        "render",
        "again.l4gs",
        "--out",
        "still",
        "--path",
        "frozen",
        "--time",
        "0.5",
        "--frames",
        "2",
    ]));
    assert_eq!(w.names("still"), ["0000.png", "0001.png"]);
    assert_success(&w.run(["export", "again.l4gs", "--out", "ply", "--frames", "2"]));
    assert_success(&w.run(["export", "again.l4gs", "--out", "frames.v2/", "--frames", "1"]));
    assert_eq!(w.names("frames.v2"), ["0000.ply"]);
    for unknown in ["scene.splat", "scene.gltf", "frames.v3"] {
        assert_refused(
            &w.run(["export", "again.l4gs", "--out", unknown]),
            &[unknown, ".ply", ".zip", ".glb", ".4dgs", "slash"],
        );
        assert!(!w.path(unknown).exists());
    }
    let ply = light4gs_data::GaussianPly::read(&w.path("ply/0001.ply")).unwrap();
    assert_eq!(ply.len() as u64, info["gaussians"].as_u64().unwrap());
}

#[test]
fn masks_of_the_dataset_split_quality_into_what_moves_and_what_stands_still() {
    let w = trained();
    const KEYS: [&str; 4] = ["moving_psnr", "still_psnr", "moving_ssim", "still_ssim"];
    // The run was trained elsewhere, so it names another folder.
    let eval = |run: &str| -> serde_json::Value {
        let output = w.run(["eval", run, "--scene", "scene", "--json"]);
        assert_success(&output);
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let masked = eval("run");
    let test = &masked["splits"][0];
    let [moving, still, ..] = KEYS.map(|key| test[key].as_f64().unwrap());
    let whole = test["psnr"].as_f64().unwrap();
    assert!(moving.min(still) < whole && whole < moving.max(still), "{moving}, {still}, whole {whole}");
    assert!(test["worst_psnr"].as_f64().unwrap() < whole.min(moving));
    assert!(KEYS.iter().all(|key| test["views"][0][key].is_number()), "{test}");
    let report = fs::read_to_string(w.path("run/report.html")).unwrap();
    assert!(report.contains("test PSNR, moving") && report.contains(">still SSIM<"));
    let text = String::from_utf8(w.run(["eval", "run", "--scene", "scene"]).stdout).unwrap();
    assert!(text.contains("moving dB") && text.contains(&format!("{moving:.2}")), "{text}");

    // Without masks the rest is the same to the last bit.
    fs::rename(w.path("run"), w.path("plain")).unwrap();
    fs::rename(w.path("scene/mask"), w.path("masks")).unwrap();
    let plain = eval("plain");
    assert!(KEYS.iter().all(|key| plain["splits"][0].get(key).is_none()));
    for key in ["psnr", "ssim", "ms_ssim", "worst_psnr"] {
        assert_eq!(plain["splits"][0].get(key), test.get(key), "{key}");
    }
    assert!(!fs::read_to_string(w.path("plain/report.html")).unwrap().contains(">moving dB<"));
    assert_success(&w.train("run", &["seed=1"]).output().unwrap());
    fs::rename(w.path("masks"), w.path("scene/mask")).unwrap();
    eval("run");
    let compared = String::from_utf8(w.run(["compare", "plain", "run"]).stdout).unwrap();
    assert!(KEYS.iter().all(|key| compared.contains(&format!("splits.test.{key}"))), "{compared}");

    // Half a set of masks, and one that is no image.
    fs::write(w.path("scene/mask/test/r_001.png"), "hello").unwrap();
    assert_refused(&w.run(["eval", "run", "--scene", "scene"]), &["mask/test/r_001.png"]);
    fs::remove_file(w.path("scene/mask/test/r_001.png")).unwrap();
    assert_refused(&w.run(["eval", "run", "--scene", "scene"]), &["mask/test/r_001.png", "2 of the 3", "remove"]);
}

#[test]
fn both_devices_train() {
    let w = Workspace::new(PROGRAM);
    for device in ["ndarray", "flex"] {
        assert_success(&w.train(device, &[]).args(["--device", device]).output().unwrap());
    }
}

/// The expected bits of all attributes are the sum over each, and the bits that are written for each are in the file.
fn assert_bits_of_attributes_add_up(coding: &serde_json::Value) {
    let attributes = coding["attributes"].as_array().unwrap();
    let names: Vec<&str> = attributes.iter().map(|attribute| attribute["name"].as_str().unwrap()).collect();
    assert!(["means", "quats", "sh_dc"].iter().all(|name| names.contains(name)), "{names:?}");
    for (kind, head) in [("estimated_bits", 0.0), ("coded_bits", 8.0 * 150.0)] {
        let each: Vec<f64> = attributes.iter().map(|attribute| attribute[kind].as_f64().unwrap()).collect();
        assert!(each.iter().all(|bits| *bits > 0.0), "{kind}: {each:?}");
        let rest = coding[kind]["attributes"].as_f64().unwrap() - each.iter().sum::<f64>();
        assert!((-1e-3..=head).contains(&rest), "{kind}: {rest} bits are of no attribute");
    }
}

#[test]
fn a_run_with_the_rate_in_its_loss() {
    let w = Workspace::new(PROGRAM);
    let output = w.train("run", &TINY_COMPRESSION).arg("--json").output().unwrap();
    assert_success(&output);
    let eval: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let coding = &eval["coding"];
    assert_eq!(coding["profile"], "compact");
    assert_eq!(coding["fit_seconds"], serde_json::Value::Null, "the models were trained with the scene");
    let bits = |part: &str| ["estimated_bits", "coded_bits"].map(|kind| coding[kind][part].as_f64().unwrap());
    // In so small a scene, the whole words at the ends of sub-streams matter; apart from them the sizes agree within
    // two percent.
    let [expected, coded] = bits("planes");
    assert!((expected - coded).abs() < 0.02 * coded + 600.0, "{expected} bits expected, {coded} coded");
    // In so few iterations most harmonics are still exactly zero, which costs less than an untrained model says.
    let [expected, coded] = bits("sh");
    assert!(coded <= expected, "{expected} bits expected, {coded} coded");
    assert_bits_of_attributes_add_up(coding);
    assert!(w.names("run").contains(&"coding.json".to_owned()) && w.names("run").contains(&"bit_maps.json".to_owned()));

    // The same scene in other profiles, and with models fitted anew.
    let size = |name: &str, overrides: &[&str]| {
        let mut command = w.command(["encode", "run", "--out", name, "--device", "flex"]);
        for key_value in overrides {
            command.args(["--set", key_value]);
        }
        assert_success(&command.output().unwrap());
        let info: serde_json::Value = serde_json::from_slice(&w.run(["info", name, "--json"]).stdout).unwrap();
        (info["bytes"].as_u64().unwrap(), info["profile"].clone())
    };
    let (compact, profile) = size("compact.l4gs", &[]);
    assert_eq!(profile, "compact");
    let (paper, profile) = size("paper.l4gs", &["compression.profile=paper"]);
    assert_eq!(profile, "paper");
    let (plain, profile) = size("plain.l4gs", &["compression.profile=float32"]);
    assert_eq!(profile, serde_json::Value::Null);
    assert!(compact < paper && paper < plain, "{compact}, {paper}, {plain}");
    size("fitted.l4gs", &["compression.context.parts=[]"]);
    assert_success(&w.run(["eval", "fitted.l4gs", "--scene", "scene"]));

    let output = w.run(["encode", "run", "--out", "x.l4gs", "--set", "train.log_interval=7"]);
    assert_refused(&output, &["encode --set", "compression"]);
    assert!(!w.path("x.l4gs").exists());
}

/// Everything that compresses on a GPU, down to a file that any back end reads to the same bits.
#[test]
fn a_run_with_the_rate_in_its_loss_on_wgpu() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.train("run", &TINY_COMPRESSION).args(["--device", "wgpu"]).output().unwrap());
    let decoded = light4gs_codec::decode(&fs::read(w.path("run/scene.l4gs")).unwrap()).unwrap();
    for (name, device) in devices() {
        let scene: DynamicScene = DynamicScene::from_arrays(&decoded, &device).unwrap();
        assert_eq!(scene.to_arrays(decoded.meta.clone()).unwrap(), decoded, "{name}");
    }
    assert_success(&w.run(["eval", "run/scene.l4gs", "--scene", "scene", "--device", "flex"]));
    // The checkpoint is no GPU's either.
    assert_success(&w.run(["encode", "run", "--out", "again.l4gs", "--device", "flex"]));
    assert!(light4gs_codec::decode(&fs::read(w.path("again.l4gs")).unwrap()).is_ok());
}

#[test]
fn layers_on_top() {
    let w = Workspace::new(PROGRAM);
    let train = |config: &str| w.run(["train", "scene", "--quiet", "--config", config, "--out", "run"]);
    assert_refused(&train("hexplane-dnerf-cpu+nothing"), &["nothing"]);
    assert_refused(&train("medium+hexplane-dnerf-cpu"), &["hexplane-dnerf-cpu", "extends"]);
    assert!(w.names("run").is_empty());
}

#[test]
fn a_run_is_never_overwritten_by_accident() {
    let w = trained();
    let before = fs::read(w.path("run/scene.l4gs")).unwrap();
    assert_refused(&w.train("run", &[]).output().unwrap(), &["run", "--overwrite"]);
    assert_eq!(fs::read(w.path("run/scene.l4gs")).unwrap(), before);
    assert_success(&w.train("run", &["seed=1"]).arg("--overwrite").output().unwrap());
    assert_ne!(fs::read(w.path("run/scene.l4gs")).unwrap(), before);

    fs::create_dir(w.path("mine")).unwrap();
    fs::write(w.path("mine/notes.txt"), "keep").unwrap();
    assert_refused(&w.train("mine", &[]).arg("--overwrite").output().unwrap(), &["mine", "no run"]);
    assert_eq!(w.names("mine"), ["notes.txt"]);
}

/// Trains on a damaged scene: refused, the words are named, and no run is left behind.
#[track_caller]
fn assert_scene_refused(w: &Workspace, words: &[&str]) {
    assert_refused(&w.train("run", &[]).output().unwrap(), words);
    assert!(!w.path("run/scene.l4gs").exists());
}

fn edit(w: &Workspace, file: &str, change: impl FnOnce(&mut serde_json::Value)) {
    let path = w.path("scene").join(file);
    let mut value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, serde_json::to_vec(&value).unwrap()).unwrap();
}

#[test]
fn a_missing_image() {
    let w = Workspace::new(PROGRAM);
    fs::remove_file(w.path("scene/train/r_003.png")).unwrap();
    assert_scene_refused(&w, &["r_003"]);
    assert!(!w.path("run").exists());
}

#[test]
fn a_truncated_image() {
    let w = Workspace::new(PROGRAM);
    let path = w.path("scene/train/r_003.png");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert_scene_refused(&w, &["r_003.png"]);
}

#[test]
fn an_image_of_another_size() {
    let w = Workspace::new(PROGRAM);
    let other = light4gs_data::RgbImage8 { width: 16, height: 8, pixels: vec![0; 16 * 8 * 3] };
    other.save_png(&w.path("scene/train/r_003.png")).unwrap();
    assert_scene_refused(&w, &["r_003.png", "16"]);
}

#[test]
fn a_frame_without_time() {
    let w = Workspace::new(PROGRAM);
    edit(&w, "transforms_train.json", |json| {
        json["frames"][2].as_object_mut().unwrap().remove("time");
    });
    assert_scene_refused(&w, &["transforms_train.json", "frames[2]", "time"]);
    assert!(!w.path("run").exists());
}

#[test]
fn a_pose_that_is_not_a_number() {
    let w = Workspace::new(PROGRAM);
    let path = w.path("scene/transforms_train.json");
    edit(&w, "transforms_train.json", |json| json["frames"][1]["transform_matrix"][0][3] = "NaN".into());
    // Python writes a bare NaN.
    let text = fs::read_to_string(&path).unwrap().replace("\"NaN\"", "NaN");
    fs::write(&path, text).unwrap();
    assert_scene_refused(&w, &["transforms_train.json", "frames[1]", "transform_matrix"]);
}

#[test]
fn an_empty_split() {
    let w = Workspace::new(PROGRAM);
    edit(&w, "transforms_train.json", |json| json["frames"] = serde_json::json!([]));
    assert_scene_refused(&w, &["transforms_train.json", "frames"]);
}

#[test]
fn an_unknown_key() {
    let w = Workspace::new(PROGRAM);
    fs::write(w.path("mine.toml"), "extends = \"hexplane-dnerf-cpu\"\n[train.densify.adaptive]\nintervall = 3\n")
        .unwrap();
    let output = w.run(["train", "scene", "--config", "mine.toml", "--out", "run"]);
    assert_refused(&output, &["mine.toml", "train.densify.adaptive.intervall", "train.densify.adaptive.interval"]);
    assert_refused(
        &w.train("run", &["train.photometric.lamda_dssim=1"]).output().unwrap(),
        &["lamda_dssim", "lambda_dssim"],
    );
    assert_refused(&w.train("run", &["device=cuda"]).output().unwrap(), &["device", "ndarray"]);
    assert!(!w.path("run").exists());
}

#[test]
fn damaged_streams() {
    let w = trained();
    let bytes = fs::read(w.path("run/scene.l4gs")).unwrap();
    fs::write(w.path("short.l4gs"), &bytes[..bytes.len() - 7]).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 4;
    fs::write(w.path("flipped.l4gs"), flipped).unwrap();
    fs::write(w.path("other.l4gs"), b"not a stream").unwrap();
    for name in ["short.l4gs", "flipped.l4gs", "other.l4gs", "absent.l4gs"] {
        assert_refused(&w.run(["info", name]), &[name]);
        assert_refused(&w.run(["decode", name, "--out", "plain.safetensors"]), &[name]);
        assert_refused(&w.run(["render", name, "--out", "x.gif"]), &[name]);
        assert_refused(&w.run(["export", name, "--out", "ply"]), &[name]);
        assert_refused(&w.run(["eval", name, "--scene", "scene"]), &[name]);
    }
    for left in ["plain.safetensors", "x.gif", "ply"] {
        assert!(!w.path(left).exists(), "{left} was left behind");
    }
}

/// A file-size limit stands for a full disk: the write fails midway, with EFBIG instead of ENOSPC.
#[cfg(unix)]
#[test]
fn a_full_disk() {
    let w = trained();
    let before = w.names("");
    for arguments in ["encode run --out out.l4gs", "decode run/scene.l4gs --out out.safetensors"] {
        // The signal that would kill the program on reaching the limit is ignored, so that it sees the error.
        let script = format!("trap '' XFSZ; ulimit -f 16; exec '{PROGRAM}' {arguments}");
        let output = std::process::Command::new("bash").args(["-c", &script]).current_dir(w.path("")).output().unwrap();
        assert_refused(&output, &["write", "out."]);
        assert_eq!(w.names(""), before, "{arguments} left something behind");
    }
}

/// A reader that goes away, as `head` does, is no error; a full disk behind the redirection is one.
#[cfg(target_os = "linux")]
#[test]
fn standard_output_that_takes_nothing() {
    let w = trained();
    let info = |stdout: std::process::Stdio| w.command(["info", "run/scene.l4gs"]).stdout(stdout).output().unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    assert_success(&info(writer.into()));
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    assert_refused(&info(full.into()), &["standard output", "redirect"]);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let complaint = w.command(["info", "nowhere.l4gs"]).stderr(writer).status().unwrap();
    assert_eq!(complaint.code(), Some(2), "an error that nobody reads is still wrong input");
}

#[test]
fn wrong_arguments() {
    let w = Workspace::new(PROGRAM);
    assert_refused(&w.run(["train", "scene"]), &["--out"]);
    assert_refused(&w.run(["polish"]), &["polish"]);
    assert_refused(&w.run(["resume", "scene"]), &["scene", "run.json"]);
    assert_refused(&w.run(["train", "nowhere", "--out", "run"]), &["nowhere"]);
    assert_refused(&w.run(["bench", "--device", "abacus"]), &["abacus", "ndarray"]);
    assert_refused(&w.run(["bench", "--gaussians", "0"]), &["--gaussians", "between 1"]);
    assert_refused(&w.run(["synth", "scene"]), &["scene"]);
    assert_refused(&w.run(["view"]), &["FILE|RUN"]);
    assert_refused(&w.run(["view", "scene", "--trainer", "x.wasm"]), &["--trainer"]);
    assert_refused(&w.run(["view", "--trainer", "x.wasm"]), &["x.wasm"]);
    assert_refused(&w.run(["view", "--trainer", "scene/transforms_train.json"]), &["no WebAssembly", "build-trainer"]);
    for command in [
        "quickstart",
        "prepare",
        "train",
        "resume",
        "eval",
        "render",
        "view",
        "import",
        "encode",
        "decode",
        "info",
        "export",
        "synth",
        "study",
        "compare",
        "bench",
    ] {
        let output = w.run([command, "--help"]);
        assert_success(&output);
        assert!(String::from_utf8_lossy(&output.stdout).contains("\nExample"), "{command} --help has no example");
    }
}

/// The scene that `synth` makes is in no table of published scenes.
#[test]
fn a_scene_that_is_not_known_is_not_taken_for_a_known_one() {
    let w = Workspace::new(PROGRAM);
    let output = w.run(["check", "scene", "--json"]);
    assert_success(&output);
    let checked: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(checked.get("known"), Some(&serde_json::Value::Null));
    assert!(!String::from_utf8_lossy(&w.run(["check", "scene"]).stdout).contains("known:"));
}
