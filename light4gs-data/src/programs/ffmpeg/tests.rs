//! Frames of videos that the tests make. Skipped, with a message, where ffmpeg is not installed.

use super::*;
use crate::images::RgbImage8;
use std::fs;
use std::path::{Path, PathBuf};

/// Width and height of the videos.
pub(crate) const SIZE: (u32, u32) = (64, 48);

pub(crate) fn installed() -> bool {
    let problem = FFMPEG.version().err();
    if let Some(problem) = &problem {
        println!("skipped: {problem}");
    }
    problem.is_none()
}

/// The gray level of a frame.
fn level(frame: usize) -> u8 {
    (40 + 4 * frame) as u8
}

/// The value of `setpts` for frames at these times in seconds, in the order of the frames.
pub(crate) fn shown_at(times: &[f64]) -> String {
    // ffmpeg cuts times to whole units.
    let at = times.iter().enumerate().map(|(i, time)| format!("eq(N,{i})*{}", time + 1e-4));
    format!("setpts='({})/TB'", at.collect::<Vec<_>>().join("+"))
}

/// Makes a video of gray frames with a moving white bar. `arguments` stand behind the input.
pub(crate) fn clip(folder: &Path, name: &str, frames: usize, rate: f64, arguments: &[&str]) -> PathBuf {
    let stills = folder.join(format!("{name}-stills"));
    fs::create_dir_all(&stills).unwrap();
    for k in 0..frames {
        let pixel = |i: u32| {
            let (x, y) = (i % SIZE.0, i / SIZE.0);
            let bar = y >= SIZE.1 / 2 && x / 8 == k as u32 % 8;
            [if bar { 255 } else { level(k) }; 3]
        };
        let pixels = (0..SIZE.0 * SIZE.1).flat_map(pixel).collect();
        let image = RgbImage8 { width: SIZE.0, height: SIZE.1, pixels };
        image.save_png(&stills.join(format!("{k:04}.png"))).unwrap();
    }
    let video = folder.join(name);
    let mut command = FFMPEG.command();
    command.args(["-y", "-loglevel", "error", "-framerate", &rate.to_string(), "-i"]).arg(stills.join("%04d.png"));
    command.args(passthrough(FFMPEG.version().unwrap())).args(arguments);
    if !arguments.contains(&"-c:v") {
        command.args(["-c:v", "libx264", "-crf", "4", "-pix_fmt", "yuv444p"]);
    }
    FFMPEG.run(command.arg(&video), "writing the video", "").unwrap();
    video
}

fn taken(video: &Path, wanted: &Wanted) -> (PathBuf, Taken) {
    let folder = video.with_extension(format!("frames-{}", wanted.suffix()));
    let _ = fs::remove_dir_all(&folder);
    let info = video_info(video).unwrap();
    let mut last = 0;
    let taken = extract_frames(video, &info, &folder, wanted, &mut |done| last = done).unwrap();
    assert!(last >= taken.seconds.len());
    assert_eq!(Taken::read(&folder, taken.seconds.len()).as_ref(), Some(&taken));
    (folder, taken)
}

/// The pixels of a frame.
fn pixels(folder: &Path, number: usize) -> RgbImage8 {
    let file = fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let path =
        file.into_iter().find(|path| path.file_stem().is_some_and(|stem| stem == format!("{number:04}").as_str()));
    let bytes = fs::read(path.unwrap()).unwrap();
    let image = image::load_from_memory(&bytes).unwrap().to_rgb8();
    RgbImage8 { width: image.width(), height: image.height(), pixels: image.into_raw() }
}

/// The red value of a pixel.
pub(crate) fn gray(image: &RgbImage8, x: u32, y: u32) -> i32 {
    i32::from(image.pixels[3 * (y * image.width + x) as usize])
}

#[test]
fn frames_have_the_times_at_which_they_are_shown() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // Ten frames at 30 a second, ten at 5.
    let times: Vec<f64> = (0..20).map(|i| if i < 10 { i as f64 / 30.0 } else { 0.3 + (i - 9) as f64 / 5.0 }).collect();
    let video = clip(folder.path(), "v.mp4", 20, 30.0, &["-vf", &shown_at(&times), "-video_track_timescale", "30000"]);
    let (_, all) = taken(&video, &Wanted { jpeg: true, ..Wanted::default() });
    assert_eq!(all.seconds.len(), 20);
    for (found, expected) in all.seconds.iter().zip(&times) {
        assert!((found - expected).abs() < 1e-3, "{found}, expected {expected}");
    }
    // The first frame of each half of a second, as it is.
    let (images, some) = taken(&video, &Wanted { pace: Pace::FirstOfEach(2.0), ..Wanted::default() });
    assert!((4..=5).contains(&some.seconds.len()), "{:?}", some.seconds);
    for (k, found) in some.seconds.iter().enumerate() {
        let frame = times.iter().position(|time| (time - found).abs() < 1e-3).unwrap();
        assert!(frame == 0 || (times[frame] * 2.0).floor() > (times[frame - 1] * 2.0).floor(), "{found}");
        let value = gray(&pixels(&images, k), 5, 5);
        assert!((value - i32::from(level(frame))).abs() <= 2, "{value} in frame {frame}");
    }
    assert!(all.notes.is_empty() && some.notes.is_empty(), "{:?}", all.notes);
}

#[test]
fn a_high_dynamic_range_becomes_the_usual_one() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // 75 % of the signal of HLG is the white of a picture.
    let hlg = ["-vf", "lutrgb=191:191:191,format=yuv420p10le", "-c:v", "libx264", "-crf", "1"];
    let tags = ["-color_primaries", "bt2020", "-color_trc", "arib-std-b67", "-colorspace", "bt2020nc"];
    let video = clip(folder.path(), "hlg.mp4", 3, 30.0, &[&hlg[..], &tags[..]].concat());
    assert!(video_info(&video).unwrap().hdr.is_some());
    for jpeg in [false, true] {
        let (images, taken) = taken(&video, &Wanted { jpeg, ..Wanted::default() });
        let value = gray(&pixels(&images, 1), 20, 10);
        assert!(taken.notes[0].contains("HLG"), "{:?}", taken.notes);
        if taken.notes[0].contains("were mapped") {
            assert!((value - 217).abs() < 6, "{value}");
        }
    }
}

#[test]
fn lines_of_two_times_are_separated() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let interlaced = ["-vf", "tinterlace=interleave_top,format=yuv420p", "-flags", "+ilme+ildct", "-x264opts", "tff=1"];
    let coder = ["-c:v", "libx264", "-crf", "2"];
    let video = clip(folder.path(), "tape.mp4", 20, 50.0, &[&interlaced[..], &coder[..]].concat());
    let (images, taken) = taken(&video, &Wanted::default());
    assert!(taken.notes[0].contains("interlaced"), "{:?}", taken.notes);
    let image = pixels(&images, 4);
    let combs = (4..20).map(|y| (gray(&image, 5, y) - gray(&image, 5, y + 1)).abs()).max().unwrap();
    assert!(!taken.notes[0].contains("one time") || combs <= 1, "{combs}");
}

#[test]
fn pixels_become_square_and_files_that_were_cut_are_named() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let wide = clip(folder.path(), "wide.mp4", 3, 30.0, &["-vf", "setsar=2"]);
    let (images, first) = taken(&wide, &Wanted { max_width: Some(100), ..Wanted::default() });
    let image = pixels(&images, 0);
    assert_eq!((image.width, image.height), (100, 38));
    assert!(first.notes[0].contains("2:1"), "{:?}", first.notes);
    let whole = clip(folder.path(), "whole.mkv", 60, 30.0, &["-g", "5", "-c:v", "libx264", "-crf", "4"]);
    assert!(taken(&whole, &Wanted::default()).1.notes.is_empty());
    let bytes = fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.mkv");
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let (_, taken) = taken(&cut, &Wanted::default());
    assert!(taken.seconds.len() < 50 && taken.notes[0].contains("about 60"), "{:?}", taken.notes);
}
