//! Captures of every layout with damaged files: opened and looked at, or refused, without a panic.

use super::CaptureSummary;
use crate::layouts::written::capture::{Capture, opencv};
use crate::layouts::written::{colmap, dnerf, nerfies, nerfstudio, neu3d, options};
use crate::{ImageStore, Scene, camera_curves};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The number of damaged files of each layout, or of all that `LIGHT4GS_HOSTILE_CASES` asks for.
fn cases() -> u64 {
    let asked = std::env::var("LIGHT4GS_HOSTILE_CASES").ok().and_then(|text| text.parse().ok());
    asked.unwrap_or(60)
}

/// Words that no place for a number expects, or that are at the end of what fits.
const ODD: [&str; 14] = [
    "-1",
    "0",
    "1e308",
    "-1e-308",
    "3.5e38",
    "18446744073709551615",
    "99999999999999999999999",
    "nan",
    "-inf",
    "null",
    "\"\"",
    "[]",
    "\"../../../etc/passwd\"",
    "\u{202e}",
];

/// Bytes with one kind of damage.
fn damaged(whole: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    let at = random.random_range(0..bytes.len());
    let length = random.random_range(1..=64.min(bytes.len() - at));
    match random.random_range(0..6) {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes.truncate(at),
        2 => drop(bytes.drain(at..at + length)),
        3 => drop(bytes.splice(at..at, whole[at..at + length].to_vec())),
        4 => bytes[at..at + length].fill(*[0, 0xff, b'9'].choose(random).expect("some")),
        _ => {
            // In place of the next run of what numbers are made of.
            let is_digit = |byte: &u8| byte.is_ascii_digit() || b".-+e".contains(byte);
            let begin = at + bytes[at..].iter().position(is_digit).unwrap_or(0);
            let end = begin + bytes[begin..].iter().position(|byte| !is_digit(byte)).unwrap_or(0);
            let word = ODD.choose(random).expect("some");
            drop(bytes.splice(begin..end, word.bytes()));
        }
    }
    bytes
}

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut left = vec![folder.to_path_buf()];
    while let Some(folder) = left.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { left.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}

/// Everything that `check` does.
fn look(root: &Path) {
    let Ok(scene) = Scene::open(root, &options()) else { return };
    let Ok(curves) = camera_curves(&scene, &ImageStore::new(&options(), 1 << 24), 60) else { return };
    if let Ok(summary) = CaptureSummary::of(&scene) {
        let summary = summary.with_faults(&scene, &curves);
        assert!(!summary.line().is_empty() && summary.facts.len() > 5);
    }
}

fn survives(layout: &str, write: impl FnOnce(&Path)) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    assert_eq!(Scene::open(folder.path(), &options()).unwrap().layout, layout);
    // Pictures are many and alike: each kind of file gets its share.
    let all = files(folder.path());
    let is_picture = |path: &&PathBuf| path.extension().is_some_and(|suffix| suffix == "png");
    let (pictures, others): (Vec<&PathBuf>, Vec<&PathBuf>) = all.iter().partition(is_picture);
    for case in 0..cases() {
        let random = &mut ChaCha8Rng::seed_from_u64(case);
        let kind = if random.random_range(0..5) == 0 { &pictures } else { &others };
        let path = *kind.choose(random).expect("some");
        let whole = fs::read(path).unwrap();
        fs::write(path, damaged(&whole, random)).unwrap();
        let begun = Instant::now();
        let outcome = std::panic::catch_unwind(|| look(folder.path()));
        let name = path.display();
        assert!(outcome.is_ok(), "{layout}, case {case}: {name} makes a panic");
        assert!(begun.elapsed() < Duration::from_secs(20), "{layout}, case {case}: {name} takes {:?}", begun.elapsed());
        fs::write(path, whole).unwrap();
    }
}

#[test]
fn of_nerfstudio() {
    let capture = Capture::moving("frame_", 4, Some(opencv()));
    survives("nerfstudio", |root| nerfstudio::write(root, &capture, &nerfstudio::document(&capture, false)));
}

#[test]
fn of_dnerf() {
    survives("dnerf", |root| dnerf::write(root, &Capture::moving("r_", 4, Some(opencv())), false));
}

#[test]
fn of_colmap() {
    let capture = Capture::moving("frame_", 4, Some(opencv()));
    for write in [colmap::write_text, colmap::write_binary] {
        survives("colmap", |root| {
            colmap::write_images(root, &capture);
            write(root, &capture);
        });
    }
}

#[test]
fn of_hypernerf() {
    survives("hypernerf", |root| nerfies::write(root, &Capture::moving("", 5, None), &[]));
}

#[test]
fn of_neu3d() {
    survives("neu3d", |root| neu3d::write(root, &neu3d::rig(2, 3), 3));
}
