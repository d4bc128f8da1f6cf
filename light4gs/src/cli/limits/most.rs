//! The most output that a command makes. The limits are the same for numbers from a file and from the command line.

use light4gs_codec::SceneMeta;
use light4gs_train::error::TrainError;

/// Width and height of an image.
pub(in crate::cli) const MOST_SIDE: u32 = 16_384;
/// Pixels of an image: 8K. Its rendering takes some hundred bytes for each.
const MOST_PIXELS: u64 = 1 << 25;
/// Frames of a video, files of an export.
pub(in crate::cli) const MOST_FRAMES: u32 = 100_000;

/// Size of the images to render: the file's own, or one of this width.
///
/// # Errors
/// [`TrainError::Input`] with the size that the file has, and with `--width` as the remedy.
pub(in crate::cli) fn image_size(meta: &SceneMeta, width: Option<u32>) -> Result<(u32, u32), TrainError> {
    let (own_width, own_height) = (meta.width.max(1), meta.height.max(1));
    let wanted = width.unwrap_or(own_width);
    let height = (u64::from(own_height) * u64::from(wanted)).div_ceil(u64::from(own_width)).max(1);
    let fits = wanted <= MOST_SIDE && height <= MOST_SIDE.into() && u64::from(wanted) * height <= MOST_PIXELS;
    if !fits {
        let (file, remedy) = match width {
            Some(width) => (
                format!("--width {width} gives images of {wanted}×{height} pixels, since the file's have"),
                "a smaller",
            ),
            None => ("the file says that its images have".to_owned(), "a"),
        };
        return Err(TrainError::Input(format!(
            "{file} {}×{} pixels: at most {MOST_SIDE} a side and {MOST_PIXELS} in all are drawn; give {remedy} --width",
            meta.width, meta.height
        )));
    }
    if !(meta.fov_x > 0.0 && meta.fov_x < std::f32::consts::PI) {
        return Err(TrainError::Input(format!(
            "the file says that its horizontal field of view is {} radians, expected 0 to π",
            meta.fov_x
        )));
    }
    Ok((wanted, height as u32))
}

/// Number of times to export: as requested, or as many as the file was made from.
///
/// # Errors
/// [`TrainError::Input`] if the file has more frames than the command line accepts.
pub(in crate::cli) fn frame_count(meta: &SceneMeta, frames: Option<u32>) -> Result<u32, TrainError> {
    let count = frames.unwrap_or(meta.frame_count.max(1));
    if count > MOST_FRAMES {
        return Err(TrainError::Input(format!(
            "the file says that it was made from {count} frames, more than {MOST_FRAMES}; give a number with --frames"
        )));
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_may_not_ask_for_more_than_a_user() {
        let meta =
            |width, height| SceneMeta { width, height, fov_x: 0.7, frame_count: u32::MAX, ..SceneMeta::default() };
        assert_eq!(image_size(&meta(800, 400), None).unwrap(), (800, 400));
        assert_eq!(image_size(&meta(65_536, 65_536), Some(100)).unwrap(), (100, 100));
        for (meta, width) in [(meta(65_536, 65_536), None), (meta(1, 65_536), Some(10)), (meta(16_384, 16_384), None)] {
            let text = image_size(&meta, width).unwrap_err().to_string();
            assert!(text.contains("--width"), "{text}");
        }
        assert!(image_size(&SceneMeta { fov_x: f32::NAN, ..meta(8, 8) }, None).is_err());
        assert!(frame_count(&meta(8, 8), None).unwrap_err().to_string().contains("--frames"));
        assert_eq!(frame_count(&meta(8, 8), Some(3)).unwrap(), 3);
    }
}
