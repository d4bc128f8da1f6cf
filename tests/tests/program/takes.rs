//! Takes: a base and segments in one file, trained in parts, killed, joined, measured.

use std::fs;
use std::process::Command;
use std::time::Duration;

use crate::PROGRAM;
use light4gs_codec::Limits;
use light4gs_codec::take::Take;
use light4gs_tests::program::{TINY, TINY_COMPRESSION, Workspace, assert_refused, assert_success};
use light4gs_train::config::Config;
use serde_json::Value;

/// Three seconds of a rig, ten frames per second.
fn filmed() -> Workspace {
    let w = Workspace::new(PROGRAM);
    let options = ["--seconds", "3", "--cameras", "3", "--fps", "10", "--width", "48", "--height", "36"];
    assert_success(&w.command(["synth", "rig"]).args(options).output().unwrap());
    w
}

fn train(w: &Workspace, run: &str, more: &[&str]) -> Command {
    let mut command = w.command(["train", "rig", "--config", "hexplane-dnerf-cpu", "--out", run, "--quiet"]);
    if !more.contains(&"--segment") {
        command.args(["--segment", "1"]);
    }
    let keys =
        TINY.into_iter().chain(TINY_COMPRESSION).chain(["model.field=nodes", "data.resolution=0", "device=flex"]);
    for key in keys {
        command.args(["--set", key]);
    }
    command.args(more);
    command
}

#[test]
fn a_take_is_trained_in_parts_and_plays_as_one_file() {
    let w = filmed();
    assert_success(&train(&w, "take", &["--jobs", "2"]).output().unwrap());
    let file = w.path("take/take.l4gs");
    let bytes = fs::read(&file).unwrap();
    let take = Take::read(bytes.clone(), &Limits::default()).unwrap();
    let times: Vec<_> = take.index().segments().iter().map(|segment| segment.times).collect();
    assert_eq!(times.len(), 3);
    assert_eq!(times.iter().map(|times| times.frames).sum::<u32>(), 30);
    assert!((take.meta().seconds - 2.9).abs() < 1e-6 && (take.meta().fps - 10.0).abs() < 1e-4);
    for pair in times.windows(2) {
        assert_eq!(pair[0].end, pair[1].begin);
        assert!(pair[0].stream_end > pair[0].end && pair[1].stream_begin < pair[1].begin);
        assert_eq!(take.drawn_at(pair[1].begin).len(), 2, "a fade");
    }
    // Every segment is an ordinary stream, and the base stands still.
    for number in 0..3 {
        light4gs_codec::decode(&take.segment(number).unwrap().stream).unwrap();
    }
    assert!(light4gs_codec::decode(&take.base().unwrap()).unwrap().motion.kind.is_empty());
    // A segment has half of the Gaussians: the base has the others.
    let most_gaussians = |run: &str| {
        let config = Config::from_file(w.path(run).join("config.toml")).unwrap();
        config.train.densify.strategies.adaptive.max_gaussians
    };
    assert_eq!(2 * most_gaussians("take/segments/0001"), most_gaussians("take"));

    // The same command has nothing left to do; joining gives the same file.
    assert_success(&train(&w, "take", &[]).output().unwrap());
    assert_success(&w.command(["join", "take"]).output().unwrap());
    assert!(fs::read(&file).unwrap() == bytes, "other bytes by the same command");

    let info: Value =
        serde_json::from_slice(&w.command(["info", "take/take.l4gs", "--json"]).output().unwrap().stdout).unwrap();
    assert_eq!(info["segments"].as_array().unwrap().len(), 3);
    let output = w.command(["eval", "take", "--json"]).output().unwrap();
    assert_success(&output);
    let scores: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(scores["frames"].as_array().unwrap().len(), 30, "the frames of the test camera");
    assert_eq!(scores["bytes"].as_u64().unwrap(), bytes.len() as u64);
    let crossing = scores["frames"].as_array().unwrap().iter().filter(|frame| frame["crosses_join"] == true).count();
    assert_eq!(crossing, 2);
    assert!(scores["flicker"]["at_joins"].as_f64().unwrap() > 0.0);
    assert!(fs::read_to_string(w.path("take/report.html")).unwrap().contains("Flicker"));

    // What is for one clip names what a take has in its place.
    let clip_only = |arguments: &[&str]| w.command(arguments.iter().copied()).output().unwrap();
    assert_refused(
        &clip_only(&["decode", "take/take.l4gs", "--out", "x"]),
        &["take", "segments/0000", "light4gs export"],
    );
    assert_refused(&clip_only(&["encode", "take", "--out", "x.l4gs"]), &["segments/0000", "light4gs join"]);

    // Frames of the test camera, as `eval` draws them.
    let render =
        |more: &[&str]| w.command(["render", "take/take.l4gs", "--out", "frames"]).args(more).output().unwrap();
    assert_refused(&render(&["--device", "wgpu"]), &["--device wgpu", "take", "leave out --device"]);
    assert_success(&render(&["--scene", "rig"]));
    let frames = w.names("frames");
    assert_eq!(frames.len(), 30, "{frames:?}");
    assert_ne!(
        fs::read(w.path("frames").join(&frames[0])).unwrap(),
        fs::read(w.path("frames").join(&frames[29])).unwrap()
    );
}

#[test]
fn a_take_that_is_killed_ends_with_the_same_bytes() {
    let w = filmed();
    assert_success(&train(&w, "whole", &[]).output().unwrap());
    let expected = fs::read(w.path("whole/take.l4gs")).unwrap();
    // Killed before there was a take.
    fs::create_dir(w.path("killed")).unwrap();
    fs::write(w.path("killed/config.toml"), "").unwrap();
    let mut kills = 0;
    for attempt in 1..200 {
        let mut child = train(&w, "killed", &[]).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(60 * attempt));
        match child.try_wait().unwrap() {
            Some(status) => {
                assert!(status.success());
                break;
            }
            None => {
                child.kill().unwrap();
                child.wait().unwrap();
                kills += 1;
            }
        }
    }
    assert!(kills > 3, "{kills} kills");
    assert!(fs::read(w.path("killed/take.l4gs")).unwrap() == expected, "other bytes after {kills} kills");
}

#[test]
fn the_first_part_plays_before_the_rest_is_trained() {
    let w = filmed();
    assert_success(&train(&w, "take", &[]).output().unwrap());
    fs::remove_dir_all(w.path("take/segments/0001")).unwrap();
    fs::remove_dir_all(w.path("take/segments/0002")).unwrap();
    assert_success(&w.command(["join", "take"]).output().unwrap());
    let take = Take::read(fs::read(w.path("take/take.l4gs")).unwrap(), &Limits::default()).unwrap();
    assert_eq!((take.len(), take.segment_at(0.5), take.segment_at(1.5)), (1, Some(0), None));
    let output = w.command(["eval", "take", "--json"]).output().unwrap();
    assert_success(&output);
    let scores: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(scores["frames"].as_array().unwrap().len(), 10, "frames that no segment shows are left out");

    assert_refused(&w.command(["resume", "take", "--set", "seed=1"]).output().unwrap(), &["is a take", "--set"]);
    assert_success(&w.command(["resume", "take", "--quiet"]).output().unwrap());
    let whole = Take::read(fs::read(w.path("take/take.l4gs")).unwrap(), &Limits::default()).unwrap();
    assert_eq!((whole.len(), whole.segment_at(1.5)), (3, Some(1)));
}

#[test]
fn what_is_filmed_later_is_added_and_the_rest_stays() {
    let w = filmed();
    assert_success(&train(&w, "take", &[]).output().unwrap());
    let read = || Take::read(fs::read(w.path("take/take.l4gs")).unwrap(), &Limits::default()).unwrap();
    let before = read();
    // With its own dataset there is nothing to add.
    assert_success(&w.command(["extend", "take", "rig", "--quiet"]).output().unwrap());
    let longer = ["--seconds", "4", "--cameras", "3", "--fps", "10", "--width", "48", "--height", "36"];
    assert_success(&w.command(["synth", "longer"]).args(longer).output().unwrap());
    assert_success(&w.command(["extend", "take", "longer", "--quiet"]).output().unwrap());
    let after = read();
    assert_eq!((before.len(), after.len()), (3, 4));
    assert!(before.base().unwrap() == after.base().unwrap());
    for number in 0..3 {
        assert!(before.segment(number).unwrap().stream == after.segment(number).unwrap().stream, "segment {number}");
    }
    let times = after.index().segments()[3].times;
    assert_eq!((times.frames, times.begin), (10, after.index().segments()[2].times.end));
    assert!((after.meta().seconds - 3.9).abs() < 1e-6);
    // Again there is nothing to do; a shorter take is none that goes on.
    assert_success(&w.command(["extend", "take", "longer", "--quiet"]).output().unwrap());
    assert_refused(&w.command(["extend", "take", "rig"]).output().unwrap(), &["30 frames", "more frames"]);
}

/// The time that is wished is that of all parts, and the bytes are those of the file.
#[test]
fn wishes_are_for_the_take() {
    let w = filmed();
    assert_success(&train(&w, "small", &["--target-bytes", "40k"]).output().unwrap());
    let bytes = fs::metadata(w.path("small/take.l4gs")).unwrap().len();
    assert!((20_000..=40_000).contains(&bytes), "{bytes} bytes");
    let error = train(&w, "none", &["--target-bytes", "1k"]).output().unwrap();
    assert_refused(&error, &["target", "bytes"]);
}

#[test]
fn no_segment_goes_beyond_a_cut() {
    let w = Workspace::new(PROGRAM);
    let options = ["--seconds", "4", "--cut", "1.25", "--fps", "10", "--width", "48", "--height", "36"];
    assert_success(&w.command(["synth", "rig"]).args(options).output().unwrap());
    assert_success(&train(&w, "take", &["--segment", "auto"]).output().unwrap());
    let record: Value = serde_json::from_slice(&fs::read(w.path("take/take.json")).unwrap()).unwrap();
    let segments: Vec<_> = record["plan"]["segments"].as_array().unwrap().iter().collect();
    let begins: Vec<_> = segments.iter().map(|one| (one["first"].as_u64(), one["begins_at_cut"] == true)).collect();
    assert_eq!(begins, [(Some(0), false), (Some(13), true)]);
    let take = Take::read(fs::read(w.path("take/take.l4gs")).unwrap(), &Limits::default()).unwrap();
    let drawn = |seconds: f64| take.drawn_at(seconds).iter().map(|one| one.segment).collect::<Vec<_>>();
    // No fade at the cut.
    assert_eq!([1.2, 1.24, 1.27, 1.3].map(drawn), [[0], [0], [1], [1]]);
}

#[test]
fn what_is_no_take_is_refused_with_a_remedy() {
    let w = filmed();

    assert_refused(&train(&w, "rig", &[]).output().unwrap(), &["rig holds files but no take"]);
    assert_refused(&w.command(["join", "rig"]).output().unwrap(), &["take.json"]);
    let jobs = w.command(["train", "rig", "--out", "x", "--jobs", "2"]).output().unwrap();
    assert_refused(&jobs, &["--jobs", "--segment"]);
    let refused = train(&w, "x", &["--minutes", "50000"]).output().unwrap();
    assert_refused(&refused, &["--minutes 50000", "give fewer minutes"]);
    // A scene whose time is not known.
    assert_success(&w.command(["synth", "plain", "--resolution", "32", "--train-frames", "12"]).output().unwrap());
    let unknown = w.command(["train", "plain", "--segment", "1", "--out", "y", "--device", "flex"]).output().unwrap();
    assert_refused(&unknown, &["data.frames_a_second"]);
    assert!(!w.path("y").exists() && !w.path("x").exists());
}
