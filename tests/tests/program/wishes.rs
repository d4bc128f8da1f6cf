//! `--pixels`, `--minutes`, `--target-bytes`, `--target-db`, and the preset that follows from the scene.

use std::fs;

use light4gs_tests::program::{Workspace, assert_refused, assert_success};

use crate::PROGRAM;

#[test]
fn wishes_become_keys() {
    let w = Workspace::new(PROGRAM);
    let key = |run: &str, name: &str| -> f64 {
        let text = fs::read_to_string(w.path(run).join("config.toml")).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
        line.unwrap_or_else(|| panic!("no {name} in {text}")).parse().unwrap()
    };
    // The preset has 10000 Gaussians for 200 pixels.
    assert_success(&w.train("small", &[]).args(["--pixels", "16"]).output().unwrap());
    assert_eq!((key("small", "resolution"), key("small", "max_gaussians")), (16.0, 291.0));
    // Keys that are set by hand win.
    let overrides = ["train.densify.adaptive.max_gaussians=400"];
    assert_success(&w.train("by-hand", &overrides).args(["--pixels", "16"]).output().unwrap());
    assert_eq!((key("by-hand", "resolution"), key("by-hand", "max_gaussians")), (16.0, 400.0));

    let arguments = ["train", "scene", "--config", "dnerf", "--pixels", "16", "--minutes", "0.3"];
    let output = w.command(arguments).args(["--set", "device=flex", "--out", "short"]).output().unwrap();
    assert_success(&output);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("16×16 pixels") && told.contains("about 0.3 minutes"), "{told}");
    let [coarse, fine] = ["coarse_iterations", "fine_iterations"].map(|name| key("short", name));
    assert!(fine < 12_000.0 && told.contains(&format!("{coarse} + {fine} iterations")), "{told}");

    for (wish, words) in [
        (["--minutes", "0"], ["--minutes", "minutes"]),
        (["--minutes", "soon"], ["--minutes", "minutes"]),
        (["--pixels", "7"], ["--pixels", "8"]),
        (["--minutes", "50000"], ["--minutes 50000", "give fewer minutes"]),
    ] {
        let arguments = ["train", "scene", "--config", "dnerf", "--out", "never"];
        assert_refused(&w.command(arguments).args(wish).args(["--set", "device=flex"]).output().unwrap(), &words);
    }
    assert!(!w.path("never").exists());
}

#[test]
fn large_images_of_a_camera_that_jumps_are_trained_thoroughly() {
    let w = Workspace::new(PROGRAM);
    let frames = ["--train-frames", "4", "--test-frames", "1", "--val-frames", "1"];
    assert_success(&w.command(["synth", "jumping", "--resolution", "400"]).args(frames).output().unwrap());
    let train = |run: &str, wishes: &[&str]| {
        let overrides =
            ["train.coarse_iterations=1", "train.fine_iterations=1", "train.prune.iterations=[]", "device=flex"];
        let overrides = overrides.iter().flat_map(|key| ["--set", key]);
        let output = w.command(["train", "jumping", "--out", run]).args(overrides).args(wishes).output().unwrap();
        assert_success(&output);
        let configuration = fs::read_to_string(w.path(run).join("config.toml")).unwrap();
        let told = String::from_utf8_lossy(&output.stderr).contains("dnerf+thorough");
        assert_eq!(told, configuration.contains("cooldown = 0.5"), "{run}");
        told
    };
    assert!(train("large", &["--pixels", "400"]));
    // At 200 pixels, where the layout's preset trains; and by a preset that is named.
    assert!(!train("small", &[]));
    assert!(!train("named", &["--pixels", "400", "--config", "dnerf"]));
}

#[test]
fn a_file_has_the_size_that_is_wished() {
    let w = Workspace::new(PROGRAM);
    let size = |name: &str| fs::metadata(w.path(name)).unwrap().len();
    let fits = |name: &str, target: u64| {
        let bytes = size(name);
        assert!(bytes <= target && bytes * 100 >= target * 95, "{name}: {bytes} of {target}");
    };
    let overrides = ["model.field=nodes", "compression.rate.attributes=true", "compression.rate.from=1"];
    assert_success(&w.train("sized", &overrides).args(["--target-bytes", "6k"]).output().unwrap());
    fits("sized/scene.l4gs", 6000);
    // A run that did not know of a size goes on with one.
    assert_success(&w.train("free", &overrides).output().unwrap());
    let longer = ["--set", "compression.target_bytes=5500", "--set", "train.fine_iterations=60"];
    assert_success(&w.command(["resume", "free", "--quiet"]).args(longer).output().unwrap());
    fits("free/scene.l4gs", 5500);
    // The same training, another size.
    let encode = |bytes: &str| w.run(["encode", "sized", "--out", "other.l4gs", "--target-bytes", bytes]);
    assert_success(&encode("5000"));
    fits("other.l4gs", 5000);
    assert_refused(&encode("1k"), &["compression.target_bytes is 1000", "coarsest steps"]);
    assert_refused(&encode("soon"), &["--target-bytes", "300k"]);
    assert_refused(
        &w.train("paper", &["compression.profile=paper"]).args(["--target-bytes", "6k"]).output().unwrap(),
        &["compression.target_bytes", "compact"],
    );
}

/// PSNR on the test views, as `eval.json` has it.
fn test_psnr(w: &Workspace, run: &str) -> f64 {
    let evaluation: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(w.path(run).join("eval.json")).unwrap()).unwrap();
    let splits = evaluation["splits"].as_array().unwrap();
    splits.iter().find(|split| split["split"] == "test").unwrap()["psnr"].as_f64().unwrap()
}

#[test]
fn a_file_has_the_quality_that_is_wished() {
    let w = Workspace::new(PROGRAM);
    let overrides = ["model.field=nodes", "compression.rate.attributes=true", "compression.rate.from=1"];
    assert_success(&w.train("free", &overrides).output().unwrap());
    let wished = test_psnr(&w, "free") - 0.5;
    assert_success(&w.train("wished", &overrides).args(["--target-db", &wished.to_string()]).output().unwrap());
    let above = test_psnr(&w, "wished") - wished;
    assert!((0.0..0.2).contains(&above), "{above} dB above {wished}");

    let encode = |quality: &str| w.run(["encode", "free", "--out", "other.l4gs", "--target-db", quality]);
    let size = |name: &str| fs::metadata(w.path(name)).unwrap().len();
    assert_success(&encode(&wished.to_string()));
    assert!(size("other.l4gs") < size("free/scene.l4gs"));
    let best = encode("99");
    assert_refused(&best, &["compression.target_db is 99", "finest steps", "kept: other.l4gs"]);
    assert!(size("other.l4gs") > size("free/scene.l4gs"));
    assert_refused(&encode("soon"), &["--target-db", "28.5"]);
    let both = ["encode", "free", "--out", "never.l4gs", "--target-db", "20", "--target-bytes", "6k"];
    assert_refused(&w.run(both), &["--target-db", "--target-bytes"]);
    assert!(!w.path("never.l4gs").exists());
}
