//! The facts that an image file tells before it is decoded: format, size, and whether its end is there.

use crate::error::DataError;
use crate::regular_file::open_regular_file;
use image::metadata::Orientation;
use image::{ImageDecoder, ImageFormat, ImageReader};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The longest side of an image file, pixels: the renderer's own limit.
const MAX_SIDE: u32 = 65_535;
/// Pixels of a PNG. A large one is read row by row, so that this bounds time, not memory.
const MAX_PNG_PIXELS: u64 = 1 << 28;
/// Pixels of any other image, which is decoded as a whole (3 bytes a pixel, and 3 for the result).
const MAX_PIXELS: u64 = 1 << 27;
/// How far from the end of a file its end mark may be, since some programs append data of their own.
const TAIL: u64 = 64 << 10;

/// Format and size of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ImageHeader {
    pub(crate) format: ImageFormat,
    /// Width and height of the stored pixels, before any EXIF rotation.
    pub(crate) size: (u32, u32),
    /// The rotation that turns the image upright, from its EXIF data; none without EXIF data.
    pub(crate) orientation: Orientation,
}

/// Opens an image file and finds its format. Regular files only: opening a pipe would wait for ever.
pub(crate) fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, DataError> {
    let remedy = "restore the file or remove its frame";
    let cannot = |e: std::io::Error| DataError::image(path, format!("cannot be read: {e}"), remedy);
    if !std::fs::metadata(path).map_err(cannot)?.is_file() {
        return Err(DataError::image(path, "is not a file", "put an image there or remove its frame"));
    }
    ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(cannot)
}

/// Reads the header of an image, refuses sizes beyond the limits, and looks for the end mark of the file.
pub(crate) fn read_header(path: &Path) -> Result<ImageHeader, DataError> {
    let reader = open(path)?;
    let bad = |what: String| DataError::image(path, what, "restore the file or remove its frame");
    let unreadable =
        |what: String| bad(format!("its header cannot be read ({what}), expected a PNG, JPEG or GIF image"));
    let format = match reader.format() {
        Some(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Gif)) => format,
        Some(other) => {
            let problem = format!("it is a {other:?} file, whatever its name says; expected a PNG, JPEG or GIF image");
            return Err(DataError::image(path, problem, "convert it, for example with `ffmpeg -i IN OUT.png`"));
        }
        None => return Err(unreadable("the format is not known".into())),
    };
    let mut decoder = reader.into_decoder().map_err(|e| unreadable(e.to_string()))?;
    let size = decoder.dimensions();
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let pixels = u64::from(size.0) * u64::from(size.1);
    let most = if format == ImageFormat::Png { MAX_PNG_PIXELS } else { MAX_PIXELS };
    if pixels == 0 || size.0.max(size.1) > MAX_SIDE || pixels > most {
        return Err(DataError::image(
            path,
            format!(
                "it says that it is {} x {} pixels, expected at most {MAX_SIDE} on a side and {most} together",
                size.0, size.1
            ),
            "scale the images down first, for example with `ffmpeg -i IN -vf scale=1920:-1 OUT`",
        ));
    }
    if !has_end(path, format).map_err(DataError::io("read", path))? {
        return Err(bad("the end of the file is missing: it is truncated".into()));
    }
    Ok(ImageHeader { format, size, orientation })
}

/// The headers of many images, read in parallel, in their order.
///
/// # Errors
/// The first error in the order of the list, whatever the threads do.
pub(crate) fn read_headers<'a>(
    paths: impl IntoParallelIterator<Item = &'a Path, Iter: IndexedParallelIterator>,
) -> Result<Vec<ImageHeader>, DataError> {
    let headers: Vec<Result<ImageHeader, DataError>> = paths.into_par_iter().map(read_header).collect();
    headers.into_iter().collect()
}

/// Size (width, height) of an image, from its header alone.
///
/// # Errors
/// [`DataError::Image`] when the file is missing, its header is damaged, its end is missing, or it is larger than the
/// limits.
pub fn image_size(path: &Path) -> Result<(u32, u32), DataError> {
    Ok(read_header(path)?.size)
}

/// The rotation that turns the image upright, from its EXIF data; none without EXIF data.
pub(crate) fn orientation(path: &Path) -> Result<Orientation, DataError> {
    let decoder = open(path)?.into_decoder();
    Ok(decoder.ok().and_then(|mut decoder| decoder.orientation().ok()).unwrap_or(Orientation::NoTransforms))
}

/// Whether an orientation swaps width and height.
pub(crate) fn turns_sideways(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
    )
}

/// Whether the mark that ends a file of this format is near its end. Formats without one always pass.
fn has_end(path: &Path, format: ImageFormat) -> std::io::Result<bool> {
    let mark: &[u8] = match format {
        // The chunk's name, and its checksum, which is always the same.
        ImageFormat::Png => b"IEND\xae\x42\x60\x82",
        ImageFormat::Jpeg => b"\xff\xd9",
        _ => return Ok(true),
    };
    let mut file = open_regular_file(path)?;
    let length = file.metadata()?.len();
    let mut tail = Vec::new();
    for reach in [mark.len() as u64, TAIL] {
        file.seek(SeekFrom::Start(length.saturating_sub(reach)))?;
        tail.clear();
        file.by_ref().take(reach).read_to_end(&mut tail)?;
        if tail.windows(mark.len()).any(|window| window == mark) {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::RgbImage8;

    #[test]
    fn truncation_shows_without_decoding_and_appended_bytes_do_not_matter() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.jpg"] {
            let path = folder.path().join(name);
            let pixels = (0..64 * 48 * 3).map(|i| (i * 31 % 256) as u8).collect();
            image::RgbImage::from_raw(64, 48, pixels).unwrap().save(&path).unwrap();
            assert_eq!(image_size(&path).unwrap(), (64, 48));
            let whole = std::fs::read(&path).unwrap();
            std::fs::write(&path, [&whole[..], &[7; 500]].concat()).unwrap();
            assert_eq!(image_size(&path).unwrap(), (64, 48));
            std::fs::write(&path, &whole[..whole.len() - 20]).unwrap();
            let message = image_size(&path).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("truncated"), "{message}");
        }
    }

    /// The header of a PNG of any size, without the pixels.
    fn claim(width: u32, height: u32) -> Vec<u8> {
        let mut file = Vec::new();
        RgbImage8 { width: 1, height: 1, pixels: vec![0; 3] }.to_png(&mut file);
        file[16..20].copy_from_slice(&width.to_be_bytes());
        file[20..24].copy_from_slice(&height.to_be_bytes());
        let checksum = crc32(&file[12..29]);
        file[29..33].copy_from_slice(&checksum.to_be_bytes());
        file
    }

    impl RgbImage8 {
        fn to_png(&self, out: &mut Vec<u8>) {
            use image::ImageEncoder;
            image::codecs::png::PngEncoder::new(out)
                .write_image(&self.pixels, self.width, self.height, image::ExtendedColorType::Rgb8)
                .unwrap();
        }
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
        })
    }

    #[test]
    fn sizes_beyond_the_limits_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, claim(u32::MAX >> 1, 2)).unwrap();
        assert!(image_size(&path).unwrap_err().to_string().contains("a.png"));
        for (width, height) in [(65_536, 1), (20_000, 20_000)] {
            std::fs::write(&path, claim(width, height)).unwrap();
            let message = image_size(&path).unwrap_err().to_string();
            assert!(message.contains("a.png") && message.contains(&format!("{width} x {height}")), "{message}");
        }
        std::fs::write(&path, claim(16_000, 16_000)).unwrap();
        assert_eq!(image_size(&path).unwrap(), (16_000, 16_000));
    }

    #[test]
    fn what_is_no_image_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(image_size(folder.path()).unwrap_err().to_string().contains("is not a file"));
        let path = folder.path().join("a.png");
        std::fs::write(&path, "hello").unwrap();
        assert!(image_size(&path).unwrap_err().to_string().contains("header"));
    }
}
