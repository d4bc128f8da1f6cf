//! `light4gs bench`: its table, its counts of launches, and adapters that are missing or too small.

use crate::PROGRAM;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};

#[test]
fn bench_prints_a_table_and_json() {
    let w = Workspace::new(PROGRAM);
    let small = ["bench", "--gaussians", "200", "--size", "40", "--repeats", "1"];
    let output = w.run(small);
    assert_success(&output);
    assert!(String::from_utf8_lossy(&output.stdout).contains("matmul"));
    let output = w.run(small.into_iter().chain(["--json", "--device", "flex"]));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let timed = |part: &str| {
        let rows = json["rows"].as_array().unwrap();
        rows.iter()
            .any(|row| row["part"] == part && row["milliseconds"].as_f64() > Some(0.0) && row["device"] == "flex")
    };
    assert!(timed("nodes, training step") && timed("1024×1024 matmul"), "{json}");
    let command = json["command"].as_str().unwrap();
    assert!(
        command.ends_with("light4gs-under-test bench --gaussians 200 --size 40 --repeats 1 --json --device flex"),
        "{command}"
    );
    for key in ["commit", "machine", "date"] {
        assert!(!json[key].as_str().unwrap().is_empty(), "{key}");
    }
}

#[test]
fn the_host_part_of_a_step_has_a_table_of_its_own() {
    let w = Workspace::new(PROGRAM);
    let host = ["bench", "--host", "--device", "flex", "--repeats", "1"];
    let output = w.run(host);
    assert_success(&output);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("read-backs") && text.contains("nodes, step with noise and rate"), "{text}");
    let output = w.run(host.into_iter().chain(["--json"]));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let step = &json["rows"][0];
    assert_eq!((&step["part"], &step["read_backs"]), (&"hexplane, training step".into(), &1.into()));
    assert!(step["read_bytes"].as_u64().unwrap() > 0 && step["milliseconds"].as_f64().unwrap() > 0.0);
    assert_refused(&w.run(["bench", "--host", "--size", "40"]), &["--host", "--size"]);
}

/// Each launch costs the host some microseconds on any GPU, and software drivers do not show it. Fewer are welcome: then lower
/// the bound. Steps are the trainer's own, with densification's statistics and the noise of all attributes. Bounds are those of
/// Mesa's software driver; on SwiftShader a step launches a few more.
#[test]
fn a_step_does_not_launch_more_kernels_than_before() {
    let w = Workspace::new(PROGRAM);
    let small = ["bench", "--device", "wgpu", "--gaussians", "200", "--size", "40", "--repeats", "1", "--json"];
    let output = w.run(small);
    assert_success(&output);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = json["rows"].as_array().unwrap();
    let row = |part: &str| rows.iter().find(|row| row["part"] == part).unwrap_or_else(|| panic!("no row {part}"));
    let launches = |part: &str| row(part)["launches"].as_u64().unwrap();
    // The loss with the number of intersections; with the rate also the positions, read beside the views.
    for (part, expected) in [("training step", 1), ("step with noise", 1), ("step with noise and rate", 2)] {
        assert_eq!(row(&format!("nodes, {part}"))["read_backs"], expected, "{part}");
    }
    let adapter = rows[0]["adapter"].as_str().unwrap();
    let more = if adapter.contains("llvmpipe") { 0 } else { 10 };
    for (part, bound) in [
        ("splat forward + backward", 23),
        ("skinning forward + backward", 19),
        ("nodes, training step", 30),
        ("nodes, step with noise", 35),
        ("nodes, step with noise and rate", 41),
        ("nodes, render", 16),
        ("hexplane, training step", 71),
        ("hexplane, step with noise", 82),
        ("hexplane, step with noise and rate", 189),
    ] {
        let found = launches(part);
        assert!((1..=bound + more).contains(&found), "{part}: {found} launches, {bound} before; {adapter}");
    }
}

#[test]
fn an_error_of_the_gpu_is_reported_like_any_other() {
    let w = Workspace::new(PROGRAM);
    // 5 GiB of pixels are more than any adapter binds.
    let output = w.run(["bench", "--device", "wgpu", "--gaussians", "10", "--size", "16384", "--repeats", "1"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(!text.contains("panicked") && text.contains("error: ") && text.contains("adapter"), "{text}");
}

#[test]
fn adapters_that_are_not_there_are_refused() {
    let w = Workspace::new(PROGRAM);
    let bench = |device| w.run(["bench", "--device", device, "--gaussians", "10", "--size", "16"]);
    assert_refused(&bench("wgpu:77"), &["wgpu:77", "mesa-vulkan-drivers", "--device flex"]);
    assert_refused(&bench("vulkan"), &["vulkan", "ndarray, flex, wgpu", "wgpu:0"]);
}
