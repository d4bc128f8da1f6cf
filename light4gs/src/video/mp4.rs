//! MP4 through the program `ffmpeg`.

use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use light4gs_data::{DataError, RgbImage8};

use super::check;

/// Quality of H.264, 0 (lossless) to 51; at 18 the eye sees almost no difference.
const QUALITY: &str = "18";

/// Writes frames as an H.264 video in MP4 and returns their number. All frames must be of one size. An odd side gets
/// one more line of black, since the format needs even sides.
///
/// The first error of `frames` ends the work and is returned. The file is complete or absent.
///
/// # Errors
/// [`DataError`] naming the file: if `fps` is not a positive number, if there is no frame, if sizes differ, if `ffmpeg` is not
/// installed, and what it says if it fails.
pub(crate) fn write_mp4<E: From<DataError>>(
    path: &Path,
    frames: impl IntoIterator<Item = Result<RgbImage8, E>>,
    fps: f32,
) -> Result<usize, E> {
    let wrong = |field: &str, problem: String, remedy: &str| DataError::field(path, field, problem, remedy);
    if !(fps > 0.0 && fps.is_finite()) {
        return Err(wrong("fps", format!("{fps} frames per second"), "choose a positive rate").into());
    }
    // Beside the file, so that renaming it stays on one file system. ffmpeg is told the format, since it cannot tell
    // from the name.
    let partial = path.with_extension(format!("mp4.{}.part", light4gs_data::process_id()));
    let written = encode(path, &partial, frames, fps);
    if written.is_ok() {
        std::fs::rename(&partial, path).map_err(DataError::io("write", path))?;
    } else {
        // The file may not even exist.
        let _ = std::fs::remove_file(&partial);
    }
    written
}

fn encode<E: From<DataError>>(
    path: &Path,
    partial: &Path,
    frames: impl IntoIterator<Item = Result<RgbImage8, E>>,
    fps: f32,
) -> Result<usize, E> {
    let mut size = None;
    let mut program: Option<Child> = None;
    let mut count = 0;
    for frame in frames {
        let frame = frame.and_then(|frame| check(path, &frame, &mut size).map(|()| frame).map_err(E::from));
        let written = frame.and_then(|frame| {
            let program = match &mut program {
                Some(program) => program,
                none => none.insert(start(path, partial, frame.width, frame.height, fps)?),
            };
            let input = program.stdin.as_mut().expect("its input is a pipe");
            // If the program has ended, its output says why.
            let _ = input.write_all(&frame.pixels);
            Ok(())
        });
        if let Err(error) = written {
            if let Some(mut program) = program {
                let _ = program.kill();
                let _ = program.wait();
            }
            return Err(error);
        }
        count += 1;
    }
    let Some(mut program) = program else {
        return Err(DataError::field(path, "frames", "there is none", "render at least one").into());
    };
    drop(program.stdin.take());
    let mut said = String::new();
    if let Some(mut errors) = program.stderr.take() {
        let _ = errors.read_to_string(&mut said);
    }
    let status = program.wait().map_err(DataError::io("write", path))?;
    if !status.success() {
        let last = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("nothing").to_owned();
        let problem = format!("ffmpeg ended with {status}: {last}");
        return Err(DataError::field(path, "video", problem, "install an ffmpeg with libx264, or write a .gif").into());
    }
    Ok(count)
}

fn start(path: &Path, partial: &Path, width: u32, height: u32, fps: f32) -> Result<Child, DataError> {
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24"]);
    command.args(["-video_size", &format!("{width}x{height}"), "-framerate", &fps.to_string(), "-i", "pipe:0"]);
    command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", QUALITY]);
    command.args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]).arg(partial);
    let started = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    started.map_err(|error| match error.kind() {
        ErrorKind::NotFound => DataError::field(
            path,
            "video",
            "the program ffmpeg, which writes MP4, is not installed",
            "install it (Debian: apt-get install ffmpeg), or write a .gif",
        ),
        _ => DataError::io("start ffmpeg for", path)(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(width: u32, height: u32, value: u8) -> Result<RgbImage8, DataError> {
        Ok(RgbImage8 { width, height, pixels: vec![value; (width * height * 3) as usize] })
    }

    fn has_ffmpeg() -> bool {
        Command::new("ffmpeg").arg("-version").output().is_ok()
    }

    #[test]
    fn a_video_plays_back_with_its_frames() {
        if !has_ffmpeg() {
            eprintln!("skipped: ffmpeg is not installed");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        assert_eq!(write_mp4(&path, (0..10).map(|i| frame(33, 20, 20 * i)), 25.0).unwrap(), 10);
        // Read back as raw gray: ten frames of 34x20, each one gray, each brighter than the one before.
        let decode = ["-loglevel", "error", "-i", path.to_str().unwrap(), "-f", "rawvideo", "-pix_fmt", "gray", "-"];
        let decoded = Command::new("ffmpeg").args(decode).output().unwrap().stdout;
        assert_eq!(decoded.len(), 10 * 34 * 20);
        let centers: Vec<u8> = decoded.chunks_exact(34 * 20).map(|frame| frame[10 * 34 + 10]).collect();
        assert!(centers.windows(2).all(|pair| pair[0] < pair[1]), "{centers:?}");
    }

    #[test]
    fn errors_leave_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        let message = |result: Result<usize, DataError>| result.unwrap_err().to_string();
        assert!(message(write_mp4(&path, Vec::new(), 10.0)).contains("at least one"));
        assert!(message(write_mp4(&path, [frame(4, 4, 0)], f32::NAN)).contains("fps"));
        if has_ffmpeg() {
            let sizes = [frame(4, 4, 0), frame(4, 6, 0)];
            assert!(message(write_mp4(&path, sizes, 10.0)).contains("4x6"));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
