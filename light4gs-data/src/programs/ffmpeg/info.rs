//! What a container says about its video.

use super::FFMPEG;
use crate::error::DataError;
use std::path::Path;

/// Metadata of a video's container.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct VideoInfo {
    /// Seconds; 0 where the container does not say.
    pub(crate) duration: f64,
    /// Frames per second, in the mean; 0 where the container does not say.
    pub(crate) rate: f64,
    /// The transfer function, if it is one of a high dynamic range.
    pub(crate) hdr: Option<Hdr>,
    /// Whether a frame has lines of two times.
    pub(crate) interlaced: bool,
    /// Width and height of a pixel, if it is not square.
    pub(crate) pixel: Option<(u32, u32)>,
}

/// A transfer function of a high dynamic range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hdr {
    /// ARIB STD-B67, as phones record.
    Hlg,
    /// SMPTE ST 2084.
    Pq,
}

impl Hdr {
    /// Its usual name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Hlg => "HLG",
            Self::Pq => "PQ",
        }
    }

    /// Its name in ffmpeg.
    pub(super) fn transfer(self) -> &'static str {
        match self {
            Self::Hlg => "arib-std-b67",
            Self::Pq => "smpte2084",
        }
    }
}

/// Reads the metadata of a video.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg is absent, or finds no video in the file.
pub(crate) fn video_info(video: &Path) -> Result<VideoInfo, DataError> {
    let place = std::path::absolute(video).map_err(DataError::io("read", video))?;
    // Without an output file ffmpeg prints what it found, and ends with an error.
    let output = FFMPEG.output(FFMPEG.command().args(["-hide_banner", "-nostdin", "-i"]).arg(place))?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    parse(&text).ok_or_else(|| {
        let words = crate::programs::last_lines(text.as_bytes());
        FFMPEG.error(format!("finds no video in {}: {words}", video.display()), "check that the video plays")
    })
}

/// The number of frames in the file, without decoding them; `None` where ffmpeg does not say. Rates of containers are means, and
/// not exact.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg cannot be started.
pub(crate) fn frame_count(video: &Path) -> Result<Option<usize>, DataError> {
    let place = std::path::absolute(video).map_err(DataError::io("read", video))?;
    let mut command = FFMPEG.command();
    command.args(["-hide_banner", "-nostdin", "-i"]).arg(place);
    let output = FFMPEG.output(command.args(["-map", "0:V:0", "-c", "copy", "-f", "null", "-"]))?;
    Ok(counted(&String::from_utf8_lossy(&output.stderr)))
}

/// The last number behind `frame=`.
fn counted(text: &str) -> Option<usize> {
    text.rsplit_once("frame=")?.1.split_whitespace().next()?.parse().ok()
}

fn parse(text: &str) -> Option<VideoInfo> {
    let of_video =
        |line: &&str| line.contains("Stream #") && line.contains("Video:") && !line.contains("(attached pic)");
    let stream = text.lines().find(of_video)?;
    let before = |unit: &str| stream.split(',').find_map(|part| part.trim().strip_suffix(unit)?.trim().parse().ok());
    let duration = text.split_once("Duration: ").and_then(|(_, rest)| {
        let clock = rest.split([',', ' ', '\n']).next()?;
        clock.split(':').map(|part| part.parse::<f64>().ok()).try_fold(0.0, |sum, part| Some(60.0 * sum + part?))
    });
    let pixel = stream.split_once("SAR ").and_then(|(_, rest)| {
        let (width, height) = rest.split([' ', ',', ']']).next()?.split_once(':')?;
        Some((width.parse().ok()?, height.parse().ok()?))
    });
    let transfers = [Hdr::Hlg, Hdr::Pq];
    Some(VideoInfo {
        duration: duration.unwrap_or(0.0),
        rate: before(" fps").or(before(" tbr")).unwrap_or(0.0),
        hdr: transfers.into_iter().find(|hdr| stream.contains(hdr.transfer())),
        interlaced: ["top first", "bottom first", "top coded first", "bottom coded first"]
            .iter()
            .any(|order| stream.contains(order)),
        pixel: pixel.filter(|(width, height)| width != height && *width > 0 && *height > 0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ffmpeg_says_about_a_video() {
        let text = "Input #0, mov,mp4, from 'a.mp4':\n  Duration: 00:01:02.50, start: 0.0, bitrate: 97 kb/s\n  \
                    Stream #0:0[0x1](und): Video: h264 (High), yuv420p, 336x252, 95 kb/s, 29.97 fps, 30 tbr (default)\n";
        assert_eq!(parse(text), Some(VideoInfo { duration: 62.5, rate: 29.97, ..VideoInfo::default() }));
        assert_eq!(parse("Duration: N/A,\n Stream #0:0: Video: x"), Some(VideoInfo::default()));
        assert_eq!(parse("a.txt: Invalid data found"), None);
        assert_eq!(parse("Stream #0:0: Video: mjpeg, yuvj420p, 9x9 (attached pic)"), None);
        let phone = "Stream #0:0: Video: mjpeg, 9x9 (attached pic)\nStream #0:1(und): Video: hevc (Main 10) (hvc1 / \
                     0x31637668), yuv420p10le(tv, bt2020nc/bt2020/arib-std-b67), 1920x1080, 8413 kb/s, 28.03 fps, 600 tbn";
        assert_eq!(parse(phone), Some(VideoInfo { rate: 28.03, hdr: Some(Hdr::Hlg), ..VideoInfo::default() }));
        let tape = "Stream #0:0: Video: dvvideo, yuv411p(bottom first), 720x480 [SAR 8:9 DAR 4:3], 25 fps";
        let expected = VideoInfo { rate: 25.0, interlaced: true, pixel: Some((8, 9)), ..VideoInfo::default() };
        assert_eq!(parse(tape), Some(expected));
        let square =
            "Stream #0:0: Video: av1, yuv420p10le(tv, bt2020nc/bt2020/smpte2084, progressive), 9x9 [SAR 1:1 DAR 1:1]";
        assert_eq!(parse(square), Some(VideoInfo { hdr: Some(Hdr::Pq), ..VideoInfo::default() }));
    }
}
