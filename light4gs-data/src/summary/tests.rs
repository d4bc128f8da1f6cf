//! Summaries of small written captures.

use super::*;
use crate::images::RgbImage8;
use crate::options::LoadOptions;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// A capture of the layout `nerfstudio`: nine cameras on a circle that look at its middle, and the unit cube of points.
fn write(root: &Path, change: impl FnOnce(&mut Value)) {
    fs::create_dir_all(root.join("images")).unwrap();
    let frames: Vec<Value> = (0..9)
        .map(|i| {
            let name = format!("images/{i:04}.png");
            RgbImage8 { width: 32, height: 24, pixels: vec![99; 32 * 24 * 3] }.save_png(&root.join(&name)).unwrap();
            let (sin, cos) = (0.2 * f64::from(i)).sin_cos();
            let pose = [[cos, 0.0, sin, 4.0 * sin], [0.0, 1.0, 0.0, 0.0], [-sin, 0.0, cos, 4.0 * cos]];
            json!({"file_path": name, "transform_matrix": pose})
        })
        .collect();
    let mut document = json!({"camera_angle_x": 0.9, "frames": frames});
    change(&mut document);
    fs::write(root.join("transforms.json"), document.to_string()).unwrap();
}

fn summary(root: &Path) -> CaptureSummary {
    CaptureSummary::of(&Scene::open(root, &LoadOptions::default()).unwrap()).unwrap()
}

fn fact(summary: &CaptureSummary, what: &str) -> String {
    summary.facts.iter().find(|fact| fact.what == what).map_or(String::new(), |fact| fact.found.clone())
}

#[test]
fn what_was_read_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, |document| {
        document["frames"].as_array_mut().unwrap().remove(2);
        document["cx"] = json!(20.0);
    });
    fs::create_dir(root.join("depth")).unwrap();
    fs::copy(root.join("images/0000.png"), root.join("depth/0000.png")).unwrap();
    let summary = summary(root);
    assert_eq!(fact(&summary, "images"), "7 to train on, 1 to test, 0 to validate");
    assert_eq!(fact(&summary, "sizes"), "32 x 24 pixels");
    assert_eq!(fact(&summary, "cameras"), "1 (one moving camera)");
    assert!(
        fact(&summary, "lens").starts_with("pinhole, 51.6 degrees across, principal point up to 12 %"),
        "{summary:?}"
    );
    let times = fact(&summary, "times");
    assert_eq!(times, "8 from 0 to 1, 1 gap of 2.0 steps (the last number in the images' names)");
    let rated = LoadOptions { frames_a_second: Some(4.0), ..Default::default() };
    let rated = CaptureSummary::of(&Scene::open(root, &rated).unwrap()).unwrap();
    assert!(fact(&rated, "times").starts_with("8 from 0 to 1 in 1.75 s, 1 gap"), "{rated:?}");
    let points = fact(&summary, "points");
    assert!(points.starts_with("2000, ") && points.ends_with(" in the view of a camera"), "{points}");
    assert_eq!(fact(&summary, "not used"), "1 image in depth, 1 image in images");
    assert_eq!((fact(&summary, "masks").as_str(), summary.problems.len()), ("", 0));
    assert!(summary.notes[0].contains("have no pose"), "{summary:?}");
    let line = summary.line();
    assert!(!line.contains('\n') && line.contains("times: 8 from 0 to 1"), "{line}");
    let text = serde_json::to_string(&summary).unwrap();
    assert_eq!(serde_json::from_str::<CaptureSummary>(&text).unwrap(), summary);
}

#[test]
fn what_can_only_fail_is_a_problem() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, |_| {});
    let behind = crate::PointCloud { positions: vec![[0.0, 80.0, 0.0]; 20], colors: vec![[0.5; 3]; 20] };
    behind.write_ply(&root.join("points3d.ply"), crate::ply::Encoding::Ascii).unwrap();
    let found = summary(root);
    assert!(found.problems[0].contains("none of 20 points is in the view"), "{found:?}");
    assert_eq!(fact(&found, "points"), "20, 0 in the view of a camera");
    fs::remove_file(root.join("points3d.ply")).unwrap();
    fs::create_dir(root.join("masks")).unwrap();
    let mask = |name: &str, value: u8| {
        image::GrayImage::from_pixel(16, 12, image::Luma([value])).save(root.join("masks").join(name)).unwrap();
    };
    mask("black.png", 0);
    mask("white.png", 255);
    let with_masks = |name: fn(usize) -> &'static str| {
        write(root, |document| {
            for (i, frame) in document["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
                frame["mask_path"] = json!(format!("masks/{}", name(i)));
            }
        });
        summary(root)
    };
    let hidden = with_masks(|_| "black.png");
    assert!(hidden.problems[0].contains("hide every pixel"), "{hidden:?}");
    let some = with_masks(|i| if i == 3 { "black.png" } else { "white.png" });
    assert!(some.problems.is_empty() && fact(&some, "masks").contains("11 % of the pixels of 9 images"), "{some:?}");
    assert!(some.faults.len() == 1 && some.faults[0].contains("all of 1 of 9 images"), "{some:?}");
    let none = with_masks(|_| "white.png");
    assert!(none.faults.is_empty() && !fact(&none, "masks").contains("hidden"), "{none:?}");
}
