//! `export` of takes: frames, segments, the base alone, and what is refused.

use std::fs;
use std::path::Path;

use glam::DVec3;
use light4gs::render::PlayableTake;
use light4gs_codec::take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take};
use light4gs_codec::{GaussianArrays, Limits, SceneData, encode};
use light4gs_data::GaussianPly;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};
use serde_json::Value;

use crate::PROGRAM;
use crate::animated_glb::{NODES, Player};

/// Gaussians of the base, of which a segment hides every third.
const BASE: usize = 10;
const HIDDEN: usize = 4;
const FPS: f64 = 5.0;

fn base() -> Vec<u8> {
    let numbers = |width: usize| (0..BASE * width).map(|index| index as f32 / 16.0).collect::<Vec<f32>>();
    let gaussians = GaussianArrays {
        means: numbers(3).as_chunks().0.to_vec(),
        log_scales: vec![[-3.0; 3]; BASE],
        quats: vec![[1.0, 0.0, 0.0, 0.0]; BASE],
        opacity_logits: numbers(1),
        sh_dc: numbers(3).as_chunks().0.to_vec(),
        sh_degree: 0,
        sh_rest: Vec::new(),
        further: Vec::new(),
    };
    encode(&SceneData { gaussians, ..SceneData::default() }).unwrap()
}

/// A take with segments of control nodes that last a second each and begin at these seconds.
fn take(w: &Workspace, begins: &[f64], seconds: f64) -> Vec<u8> {
    let stream = fs::read(NODES).unwrap();
    let segment = |&begin: &f64| NewSegment {
        times: SegmentTimes {
            begin,
            end: begin + 1.0,
            stream_begin: begin - 0.4,
            stream_end: begin + 1.4,
            frames: FPS as u32,
        },
        stream: stream.clone(),
        hidden: (0..BASE).map(|index| index % 3 == 0).collect(),
    };
    let segments: Vec<NewSegment> = begins.iter().map(segment).collect();
    let meta = TakeMeta { name: "a walk".into(), fps: FPS as f32, seconds, ..TakeMeta::default() };
    let bytes = write_take(&meta, &base(), &segments, 2).unwrap();
    fs::write(w.path("take.l4gs"), &bytes).unwrap();
    bytes
}

fn exported(w: &Workspace, arguments: &[&str]) -> String {
    let output = w.command(["export", "take.l4gs", "--device", "flex"]).args(arguments).output().unwrap();
    assert_success(&output);
    String::from_utf8(output.stdout).unwrap()
}

/// The centers in a PLY file against those of the take at a time.
fn assert_frame(path: &Path, take: &PlayableTake, seconds: f64) {
    let found = GaussianPly::read(path).unwrap();
    let expected = take.at(seconds).unwrap();
    assert!(found.means == expected.means, "{}: other means than at {seconds} s", path.display());
    assert!(found.opacity_logits == expected.opacity_logits && found.quats == expected.quats, "{}", path.display());
}

#[test]
fn frames_of_a_take_are_those_of_its_seconds() {
    let w = Workspace::new(PROGRAM);
    // The third second has no segment.
    let bytes = take(&w, &[0.0, 1.0, 3.0], 4.0);
    let shown = PlayableTake::decode(bytes, &Limits::default()).unwrap();
    let text = exported(&w, &["--out", "frames"]);
    assert!(text.contains("20 PLY files") && text.contains("5 of the 20 frames have no segment"), "{text}");
    let names: Vec<String> = (0..20).map(|frame| format!("{frame:04}.ply")).collect();
    assert_eq!(w.names("frames"), names);
    for (frame, name) in names.iter().enumerate() {
        assert_frame(&w.path(&format!("frames/{name}")), &shown, frame as f64 / FPS);
    }
    assert!(exported(&w, &["--out", "frames.zip", "--fps", "2"]).contains("8 PLY files"));
    let text = exported(&w, &["--out", "take.4dgs"]);
    assert!(text.contains("20 samples") && text.contains("4.00 seconds, 5 frames per second"), "{text}");
    assert!(fs::metadata(w.path("take.4dgs")).unwrap().len() > 1000);
    exported(&w, &["--out", "one.ply", "--at", "1.7"]);
    assert_frame(&w.path("one.ply"), &shown, 1.7);
    exported(&w, &["--out", "first.ply"]);
    assert_frame(&w.path("first.ply"), &shown, 0.0);
    exported(&w, &["--out", "one.glb", "--at", "3.2"]);
    let still = Player::open(&w.path("one.glb"));
    assert!(still.json.get("skins").is_none());
    assert_eq!(still.positions_at_rest(), points(&shown.at(3.2).unwrap()));
}

fn points(gaussians: &GaussianArrays) -> Vec<DVec3> {
    gaussians.means.iter().map(|mean| DVec3::from_array(mean.map(f64::from))).collect()
}

#[test]
fn a_glb_for_each_segment_shows_base_and_motion() {
    let w = Workspace::new(PROGRAM);
    let bytes = take(&w, &[0.0, 1.0], 2.0);
    let shown = PlayableTake::decode(bytes, &Limits::default()).unwrap();
    let text = exported(&w, &["--out", "parts", "--to", "glb", "--fps", "20"]);
    assert!(text.contains("wrote 2 segments to parts") && text.contains("centers are off by"), "{text}");
    assert_eq!(w.names("parts"), ["0000.glb", "0001.glb", "base.glb", "segments.json"]);
    let list: Value = serde_json::from_slice(&fs::read(w.path("parts/segments.json")).unwrap()).unwrap();
    assert_eq!(
        (&list["base"], list["seconds"].as_f64(), &list["name"]),
        (&"base.glb".into(), Some(2.0), &"a walk".into())
    );
    let still = Player::open(&w.path("parts/base.glb"));
    assert!(still.json.get("skins").is_none());
    assert_eq!(still.positions_at_rest(), points(&shown.base().at(0.0).unwrap()));

    let visible = BASE - HIDDEN;
    for (number, segment) in list["segments"].as_array().unwrap().iter().enumerate() {
        let (begin, end) = (segment["begin"].as_f64().unwrap(), segment["end"].as_f64().unwrap());
        assert_eq!((begin, end), (number as f64, number as f64 + 1.0));
        assert_eq!(segment["file"], format!("{number:04}.glb"));
        let player = Player::open(&w.path(&format!("parts/{number:04}.glb")));
        let influences = player.influences();
        let joints = player.json["skins"][0]["joints"].as_array().unwrap().len();
        for influence in &influences[..visible] {
            let followed: Vec<&(usize, f64)> = influence.iter().filter(|(_, weight)| *weight > 0.0).collect();
            assert_eq!(followed, [&(joints - 1, 1.0)], "the base follows the joint that never moves");
        }
        // Away from the joins, where a player may show two segments.
        for seconds in [0.45, 0.5, 0.55] {
            let expected = points(&shown.at(begin + seconds).unwrap());
            let found = player.positions(seconds);
            assert_eq!((found.len(), influences.len()), (expected.len(), expected.len()));
            let off = |range: std::ops::Range<usize>| {
                let pairs = found[range.clone()].iter().zip(&expected[range]);
                pairs.map(|(found, expected)| found.distance(*expected)).fold(0.0, f64::max)
            };
            assert!(off(0..visible) < 1e-6, "{}", off(0..visible));
            let moving = off(visible..expected.len());
            assert!(moving < 0.03, "segment {number} at {seconds} s: {moving}");
        }
        // The animation lasts as long as the segment.
        let input = &player.json["animations"][0]["samplers"][0]["input"];
        let accessor = &player.json["accessors"][input.as_u64().unwrap() as usize];
        assert_eq!((accessor["count"].as_u64(), accessor["min"][0].as_f64()), (Some(21), Some(0.0)));
        assert!((accessor["max"][0].as_f64().unwrap() - 1.0).abs() < 1e-6);
    }
    // The folder of a shorter take is not left with files of a longer one.
    take(&w, &[0.0], 1.0);
    assert_refused(&w.run(["export", "take.l4gs", "--out", "parts", "--to", "glb"]), &["0001.glb", "remove them"]);
}

#[test]
fn the_first_bytes_of_a_take_are_a_scene() {
    let w = Workspace::new(PROGRAM);
    let bytes = take(&w, &[0.0, 1.0], 2.0);
    exported(&w, &["--base", "--out", "whole.glb"]);
    exported(&w, &["--base", "--out", "whole.ply"]);
    let end = Take::read(bytes.clone(), &Limits::default()).unwrap().index().base().end as usize;
    fs::write(w.path("take.l4gs"), &bytes[..end]).unwrap();
    exported(&w, &["--base", "--out", "cut.glb"]);
    exported(&w, &["--base", "--out", "cut.ply"]);
    for kind in ["glb", "ply"] {
        let [whole, cut] = ["whole", "cut"].map(|name| fs::read(w.path(&format!("{name}.{kind}"))).unwrap());
        assert!(whole == cut, "another {kind}");
    }
    assert_eq!(Player::open(&w.path("cut.glb")).positions_at_rest().len(), BASE);
    // What shows more than the base needs the whole file, and the message says what can be had.
    for arguments in [&["--out", "frames"][..], &["--out", "one.glb", "--at", "0.5"], &["--out", "a", "--to", "glb"]] {
        let output = w.command(["export", "take.l4gs"]).args(arguments).output().unwrap();
        assert_refused(&output, &["take.l4gs", "--base"]);
    }
    fs::write(w.path("take.l4gs"), &bytes[..end - 1]).unwrap();
    assert_refused(&w.run(["export", "take.l4gs", "--base", "--out", "no.glb"]), &["take.l4gs", "base"]);

    // A take that has no segment yet.
    let bytes = take(&w, &[], 1.0);
    let shown = PlayableTake::decode(bytes, &Limits::default()).unwrap();
    assert!(exported(&w, &["--out", "still"]).contains("6 of the 6 frames have no segment"));
    assert_frame(&w.path("still/0005.ply"), &shown, 1.0);
    assert!(exported(&w, &["--out", "none", "--to", "glb"]).contains("wrote 0 segments"));
    assert_eq!(w.names("none"), ["base.glb", "segments.json"]);
}

#[test]
fn a_page_holds_a_whole_take() {
    let w = Workspace::new(PROGRAM);
    let bytes = take(&w, &[0.0], 1.0);
    assert_success(&w.run(["export", "take.l4gs", "--html", "take.html"]));
    let page = fs::read_to_string(w.path("take.html")).unwrap();
    assert!(page.contains("<title>a walk</title>"));
    // Base64 of the first bytes of a take.
    assert!(page.contains(">iUw0R1QNCho") && page.len() > bytes.len());
    fs::write(w.path("take.l4gs"), &bytes[..bytes.len() - 1]).unwrap();
    assert_refused(&w.run(["export", "take.l4gs", "--html", "no.html"]), &["take.l4gs"]);
}

#[test]
fn options_of_the_other_kind_are_refused_with_a_remedy() {
    let w = Workspace::new(PROGRAM);
    take(&w, &[0.0], 1.0);
    let refuse = |arguments: &[&str], words: &[&str]| {
        assert_refused(&w.command(["export"]).args(arguments).output().unwrap(), words);
    };
    refuse(&["take.l4gs", "--out", "a.glb"], &["--to glb", "--at", "--base"]);
    refuse(&["take.l4gs", "--out", "a.glb", "--to", "glb"], &["--to glb is for a folder"]);
    refuse(&["take.l4gs", "--out", "a.ply", "--time", "0.5"], &["--at SECONDS instead of --time"]);
    refuse(&["take.l4gs", "--out", "a", "--frames", "3"], &["--fps instead of --frames"]);
    refuse(&["take.l4gs", "--out", "a", "--at", "0.5"], &["--at is one time"]);
    refuse(&["take.l4gs", "--out", "a", "--base"], &["--base is one time"]);
    refuse(&["take.l4gs", "--out", "a.ply", "--at", "1.5"], &["0 to 1.00", "1.5"]);
    refuse(&["take.l4gs", "--out", "a.ply", "--at", "nan"], &["--at must be"]);
    refuse(&["take.l4gs", "--out", "a", "--fps", "1e6"], &["--fps must be"]);
    for (option, remedy) in [(&["--at", "0.5"][..], "--time"), (&["--base"], "--time")] {
        let arguments = [&[NODES, "--out", "a.ply"], option].concat();
        refuse(&arguments, &["is for takes", remedy]);
    }
    refuse(&[NODES, "--out", "a", "--to", "glb"], &["--to glb is for takes", "scene.glb"]);
    assert!(w.names("").iter().all(|name| name != "a" && !name.starts_with("a.")));
}
