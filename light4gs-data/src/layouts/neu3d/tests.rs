//! Rigs of videos. Skipped, with a message, where ffmpeg is not installed.

use crate::images::{ImageStore, RgbImage8};
use crate::options::LoadOptions;
use crate::programs::ffmpeg::tests::{SIZE, clip, gray, installed};
use crate::scene::{Scene, Split};
use std::fs;
use std::path::{Path, PathBuf};

/// The rig of a test: three cameras, each with its video.
struct Rig(tempfile::TempDir);

impl Rig {
    fn new(videos: &[&Path]) -> Self {
        let rig = Self(tempfile::tempdir().unwrap());
        let mut table = Vec::new();
        for (i, video) in videos.iter().enumerate() {
            fs::copy(video, rig.camera(i)).unwrap();
            // Columns down, right, back, center; height, width, focal length. Then the bounds.
            let (x, size) = (i as f64, [f64::from(SIZE.1), f64::from(SIZE.0), 60.0]);
            table.extend([
                0.0, 1.0, 0.0, x, size[0], -1.0, 0.0, 0.0, 0.0, size[1], 0.0, 0.0, 1.0, 4.0, size[2], 1.0, 9.0,
            ]);
        }
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 17), }}\n", videos.len());
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(table.iter().flat_map(|value: &f64| value.to_le_bytes()));
        fs::write(rig.0.path().join("poses_bounds.npy"), bytes).unwrap();
        rig
    }

    fn camera(&self, i: usize) -> PathBuf {
        self.0.path().join(format!("cam{i:02}.mp4"))
    }

    fn open(&self, frames: Option<usize>) -> Result<Scene, String> {
        let options = LoadOptions { frames, ..LoadOptions::default() };
        Scene::open(self.0.path(), &options).map_err(|error| error.to_string())
    }

    fn times(scene: &Scene, camera: u32) -> Vec<f32> {
        let frames = scene.frames(Split::Train).iter().filter(|frame| frame.camera_id == camera);
        frames.map(|frame| frame.time).collect()
    }
}

#[test]
fn cameras_of_a_rig_have_one_clock() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let usual = clip(folder.path(), "usual.mp4", 12, 30.0, &[]);
    let slow = clip(folder.path(), "slow.mp4", 10, 25.0, &[]);
    // All alike: the number of the frame is its time, in twelfths.
    let rig = Rig::new(&[&usual, &usual, &usual]);
    let scene = rig.open(None).unwrap();
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
    assert_eq!(Rig::times(&scene, 1), (0..12).map(|i| i as f32 / 12.0).collect::<Vec<_>>());
    assert!(scene.seconds.is_some_and(|seconds| (seconds - 0.4).abs() < 1e-3), "{:?}", scene.seconds);
    // Another rate in the same time: each frame when it is shown.
    let scene = Rig::new(&[&usual, &usual, &slow]).open(None).unwrap();
    assert!(scene.notes.iter().any(|note| note.contains("25.00 frames per second")), "{:?}", scene.notes);
    for (k, time) in Rig::times(&scene, 2).into_iter().enumerate() {
        assert!((time - k as f32 / 25.0 / 0.4).abs() < 1e-3, "{time} of frame {k}");
    }
    // As many frames at another rate: nobody knows which clock is right.
    let other = clip(folder.path(), "other.mp4", 12, 20.0, &[]);
    let message = Rig::new(&[&usual, &usual, &other]).open(None).unwrap_err();
    for word in ["cam02.mp4", "20.00 frames per second in 0.60 s", "30.00 frames per second in 0.40 s", "; bring all"] {
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn a_replaced_video_and_strays_are_noticed() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let usual = clip(folder.path(), "usual.mp4", 12, 30.0, &[]);
    let rig = Rig::new(&[&usual, &usual, &usual]);
    rig.open(None).unwrap();
    let longer = clip(folder.path(), "longer.mp4", 15, 30.0, &[]);
    fs::copy(&longer, rig.camera(2)).unwrap();
    let scene = rig.open(None).unwrap();
    assert_eq!(Rig::times(&scene, 2).len(), 15);
    assert!(scene.notes.iter().any(|note| note.starts_with("cam02.mp4: it was replaced")), "{:?}", scene.notes);
    assert!(!rig.open(None).unwrap().notes.iter().any(|note| note.contains("replaced")));
    // A sequence that is shorter than asked for: the times are those of a part of a longer one.
    let scene = rig.open(Some(300)).unwrap();
    assert!(scene.notes.iter().any(|note| note.contains("300 frames") && note.contains("15")), "{:?}", scene.notes);
    assert_eq!(Rig::times(&scene, 2).last(), Some(&(14.0 / 300.0)));
    // A small picture among the frames.
    let stray = rig.0.path().join("cam01/images/preview.png");
    RgbImage8 { width: 8, height: 6, pixels: vec![0; 144] }.save_png(&stray).unwrap();
    let scene = rig.open(None).unwrap();
    assert_eq!(Rig::times(&scene, 1).len(), 12);
    assert!(scene.notes.iter().any(|note| note.contains("preview.png is 8 x 6")), "{:?}", scene.notes);
    let image = ImageStore::new(&LoadOptions::default(), 1 << 20).get(&scene.frames(Split::Train)[11]).unwrap();
    assert!(gray(&image, 5, 5) > 60, "{}", gray(&image, 5, 5));
}
