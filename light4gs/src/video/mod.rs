//! Frames over time: an animated GIF, an MP4 through the program `ffmpeg`, or numbered PNG files.
//!
//! Frames are taken one by one from an iterator, which may render them; none is kept. Files are either complete or
//! absent.

mod mp4;

use std::io;
use std::path::{Path, PathBuf};

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, RgbaImage};
use light4gs_data::{DataError, NumberedFiles, RgbImage8, write_atomically};

pub(crate) use mp4::write_mp4;

/// GIFs with a higher rate play slowly: a GIF counts in hundredths of a second, and players take a delay of less than
/// two of them for a mistake.
pub(crate) const MAX_GIF_FPS: f32 = 50.0;

/// Effort of the color quantizer, 1 (best) to 30 (fast).
const GIF_SPEED: i32 = 10;

/// Writes frames as an animated GIF that plays without end, and returns their number. All frames must be of one size.
///
/// The first error of `frames` ends the work and is returned; `E` is its type.
///
/// # Errors
/// [`DataError`] naming the file, if `fps` is not above 0 and at most [`MAX_GIF_FPS`], if there is no frame, if sizes
/// differ, or if the file cannot be written.
pub(crate) fn write_gif<E: From<DataError>>(
    path: &Path,
    frames: impl IntoIterator<Item = Result<RgbImage8, E>>,
    fps: f32,
) -> Result<usize, E> {
    if !(fps > 0.0 && fps <= MAX_GIF_FPS) {
        return Err(E::from(DataError::Field {
            path: path.to_path_buf(),
            field: "fps".to_owned(),
            problem: format!("{fps} frames per second, where a GIF has more than 0 and up to {MAX_GIF_FPS}"),
            remedy: "choose another rate, or write PNG files".to_owned(),
        }));
    }
    let mut count = 0;
    let mut stopped = None;
    let written = write_atomically(path, |out| {
        let mut size = None;
        let mut encoder = GifEncoder::new_with_speed(out, GIF_SPEED);
        encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
        for frame in frames {
            let checked = frame.and_then(|frame| check(path, &frame, &mut size).map(|()| frame).map_err(E::from));
            let frame = match checked {
                Ok(frame) => frame,
                Err(error) => {
                    stopped = Some(error);
                    return Err(io::Error::other("stopped"));
                }
            };
            let shown = image::Frame::from_parts(with_alpha(frame)?, 0, 0, delay(count, fps));
            encoder.encode_frame(shown).map_err(io::Error::other)?;
            count += 1;
        }
        if count == 0 { Err(io::Error::other("there is no frame to write")) } else { Ok(()) }
    });
    match stopped {
        Some(error) => Err(error),
        None => written.map(|()| count).map_err(E::from),
    }
}

/// Writes frames as `0000.png`, `0001.png`... into `folder`, which is made if it does not exist. Returns the files.
///
/// # Errors
/// A folder with numbered files that these do not replace ([`NumberedFiles::open_folder`]). The first error of `frames`, or [`DataError`] naming the file that cannot be written. Each file is whole or absent;
/// those before it stay.
pub(crate) fn write_png_sequence<E: From<DataError>>(
    folder: &Path,
    frames: impl IntoIterator<Item = Result<RgbImage8, E>, IntoIter: ExactSizeIterator>,
) -> Result<Vec<PathBuf>, E> {
    let frames = frames.into_iter();
    let names = NumberedFiles::new(frames.len(), "png");
    names.open_folder(folder)?;
    let mut files = Vec::new();
    for (number, frame) in frames.enumerate() {
        let path = folder.join(names.name(number));
        frame?.save_png(&path).map_err(E::from)?;
        files.push(path);
    }
    Ok(files)
}

/// A frame must have the number of bytes that follows from its size, and the size of the frames before it.
fn check(path: &Path, frame: &RgbImage8, size: &mut Option<(u32, u32)>) -> Result<(), DataError> {
    let wrong = |problem: String| DataError::Image {
        path: path.to_path_buf(),
        problem,
        remedy: "render all frames with one camera size".to_owned(),
    };
    let (width, height) = (frame.width, frame.height);
    let bytes = u64::from(width) * u64::from(height) * 3;
    if bytes == 0 || frame.pixels.len() as u64 != bytes {
        return Err(wrong(format!("a frame of {width}x{height} pixels has {} bytes", frame.pixels.len())));
    }
    match *size {
        Some((w, h)) if (w, h) != (width, height) => {
            Err(wrong(format!("a frame of {width}x{height} pixels follows one of {w}x{h}")))
        }
        _ => {
            *size = Some((width, height));
            Ok(())
        }
    }
}

fn with_alpha(frame: RgbImage8) -> io::Result<RgbaImage> {
    let pixels = frame.pixels.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], u8::MAX]).collect();
    RgbaImage::from_raw(frame.width, frame.height, pixels).ok_or_else(|| io::Error::other("a frame lacks pixels"))
}

/// The time for which frame `index` is shown: whole hundredths of a second, whose mean gives the rate.
fn delay(index: usize, fps: f32) -> Delay {
    let end = |count: usize| (count as f64 * 100.0 / f64::from(fps)).round() as u32;
    Delay::from_numer_denom_ms((end(index + 1) - end(index)) * 10, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;

    fn frame(width: u32, height: u32, value: u8) -> RgbImage8 {
        RgbImage8 { width, height, pixels: vec![value; (width * height * 3) as usize] }
    }

    #[test]
    fn a_gif_reads_back_with_its_rate() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.gif");
        let frames = (0..30).map(|i| Ok::<_, DataError>(frame(8, 6, i * 8)));
        assert_eq!(write_gif(&path, frames, 30.0).expect("a GIF"), 30);
        let file = io::BufReader::new(std::fs::File::open(&path).expect("a file"));
        let frames = GifDecoder::new(file).expect("a GIF").into_frames().collect_frames().expect("frames");
        assert_eq!(frames.len(), 30);
        let total: f64 =
            frames.iter().map(|f| f.delay().numer_denom_ms()).map(|(n, d)| f64::from(n) / f64::from(d)).sum();
        assert!((total - 1000.0).abs() < 1e-6, "{total}");
        assert_eq!(frames[9].buffer().get_pixel(3, 3).0, [72, 72, 72, 255]);
    }

    #[test]
    fn errors_leave_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.gif");
        let none: [Result<RgbImage8, DataError>; 0] = [];
        let message = write_gif(&path, none, 10.0).expect_err("no frame").to_string();
        assert!(message.contains("no frame"), "{message}");
        let sizes = [frame(4, 4, 0), frame(4, 5, 0)].map(Ok::<_, DataError>);
        let message = write_gif(&path, sizes, 10.0).expect_err("sizes").to_string();
        assert!(message.contains("4x5 pixels follows one of 4x4"), "{message}");
        for fps in [0.0, -1.0, f32::NAN, f32::INFINITY, 51.0] {
            let message = write_gif(&path, [Ok::<_, DataError>(frame(4, 4, 0))], fps);
            assert!(message.expect_err("a rate").to_string().contains("fps"));
        }
        let stopped = [
            Ok(frame(4, 4, 0)),
            Err(DataError::Io { action: "read", path: "x".into(), source: io::Error::other("gone") }),
        ];
        let message = write_gif(&path, stopped, 10.0).expect_err("stopped").to_string();
        assert!(message.contains("gone"), "{message}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn png_files_are_numbered() {
        let folder = tempfile::tempdir().expect("a folder");
        let frames = [frame(3, 2, 10), frame(3, 2, 20)].map(Ok::<_, DataError>);
        let files = write_png_sequence(&folder.path().join("new"), frames).expect("files");
        assert_eq!(files.len(), 2);
        let image = image::open(folder.path().join("new/0001.png")).expect("an image").to_rgb8();
        assert_eq!((image.dimensions(), image.get_pixel(2, 1).0), ((3, 2), [20; 3]));
    }
}
