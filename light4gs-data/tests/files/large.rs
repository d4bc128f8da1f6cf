//! A capture of the size of the genuine ones: 20 cameras of 300 frames at 1352 × 1014.

use light4gs_data::{DatasetDigest, ImageStore, LoadOptions, RgbImage8, Scene};
use std::fs;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Only one of these tests runs at a time, since they measure times.
static ALONE: Mutex<()> = Mutex::new(());

const SIZE: (u32, u32) = (1352, 1014);

/// LLFF's table for cameras in a row that look along -z.
fn poses_bounds(cameras: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({cameras}, 17), }}\n");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    for camera in 0..cameras {
        let x = camera as f64 * 0.1;
        // Columns down, right, back, center; height, width, focal length.
        let rows = [[0.0, 1.0, 0.0, x, 2028.0], [-1.0, 0.0, 0.0, 0.0, 2704.0], [0.0, 0.0, 1.0, 0.0, 1462.0]];
        let row = rows.concat().into_iter().chain([1.0, 9.0]);
        out.extend(row.flat_map(f64::to_le_bytes));
    }
    out
}

/// A photograph-like image: smooth, with some noise, so that it compresses like one.
fn image(path: &Path) {
    let pixels = (0..SIZE.0 * SIZE.1)
        .flat_map(|i| {
            let (x, y) = ((i % SIZE.0) as f32, (i / SIZE.0) as f32);
            let noise = (i.wrapping_mul(2_654_435_761) >> 29) as f32;
            let wave = |a: f32, b: f32| (120.0 + 90.0 * (x * a).sin() * (y * b).cos() + noise) as u8;
            [wave(0.01, 0.02), wave(0.03, 0.01), wave(0.02, 0.03)]
        })
        .collect();
    RgbImage8 { width: SIZE.0, height: SIZE.1, pixels }.save_png(path).unwrap();
}

/// Every frame of every camera is a link to one image.
fn capture(root: &Path, cameras: usize, frames: usize) {
    let original = root.join("original.png");
    image(&original);
    for camera in 0..cameras {
        let folder = root.join(format!("cam{camera:02}/images"));
        fs::create_dir_all(&folder).unwrap();
        for frame in 0..frames {
            fs::hard_link(&original, folder.join(format!("{frame:04}.png"))).unwrap();
        }
    }
    fs::write(root.join("poses_bounds.npy"), poses_bounds(cameras)).unwrap();
}

#[test]
fn six_thousand_images_open_quickly() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    capture(folder.path(), 20, 300);
    let begun = Instant::now();
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    let opened = begun.elapsed();
    assert_eq!((scene.train.len(), scene.test.len()), (5700, 300));
    let begun = Instant::now();
    let digest = DatasetDigest::of(&scene).unwrap();
    println!("opened in {opened:.2?}, digest in {:.2?}", begun.elapsed());
    assert!(digest.changes_since(&digest).is_empty());
    // 3 s are promised; a machine that compiles something at the same time gets more.
    assert!(opened < Duration::from_secs(12), "{opened:?}");
}

#[test]
fn images_decoded_ahead_are_there_when_they_are_asked_for() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    capture(folder.path(), 2, 40);
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    let frames = &scene.train;
    let decode = |frame| {
        let begun = Instant::now();
        ImageStore::new(&LoadOptions::default(), 0).get(frame).unwrap();
        begun.elapsed()
    };
    // The longest of several, since other tests run at the same time.
    let decoding = frames[..5].iter().map(decode).max().unwrap();
    // A quarter of the images fit.
    let store = ImageStore::new(&LoadOptions::default(), 10 * (SIZE.0 * SIZE.1 * 3) as usize);
    store.prefetch(&frames[..6]);
    let mut waits = Vec::new();
    for i in 0..40 {
        store.prefetch(&frames[(i + 6).min(39)..(i + 7).min(40)]);
        // A training step takes longer than decoding an image.
        std::thread::sleep(3 * decoding);
        let begun = Instant::now();
        store.get(&frames[i]).unwrap();
        waits.push(begun.elapsed());
        assert!(store.bytes() <= 10 * (SIZE.0 * SIZE.1 * 3) as usize);
    }
    waits[6..].sort();
    let median = waits[6 + 17];
    println!("an image takes {decoding:.1?} to decode; waited {median:.1?} in the median once warm");
    assert!(median < decoding / 10, "{median:?} of {decoding:?}");
}
