//! The filters between a video and its frames, and what they changed, in words.

use super::FFMPEG;
use super::frames::{Pace, Wanted};
use super::info::VideoInfo;
use crate::error::DataError;

/// The brightness of white in a standard picture, in nits (ITU-R BT.2408): it becomes 1 before the tones are mapped.
const WHITE: f64 = 203.0;
/// Brighter light than this, in nits, is white.
const BRIGHTEST: f64 = 1000.0;

/// A chain of filters, and notes about what it changes.
#[derive(Debug, PartialEq)]
pub(super) struct Chain {
    pub(super) filters: String,
    pub(super) notes: Vec<String>,
}

/// The chain for a video. ffmpeg is asked for its filters where one is needed that some builds lack.
pub(super) fn chain(info: &VideoInfo, wanted: &Wanted) -> Result<Chain, DataError> {
    let known = if info.interlaced || info.hdr.is_some() {
        let output = FFMPEG.output(FFMPEG.command().args(["-hide_banner", "-filters"]))?;
        String::from_utf8_lossy(&output.stdout).into_owned()
    } else {
        String::new()
    };
    let has = |name: &str| known.split_whitespace().any(|word| word == name);
    Ok(build(info, wanted, &has))
}

fn build(info: &VideoInfo, wanted: &Wanted, has: &dyn Fn(&str) -> bool) -> Chain {
    let mut filters = Vec::new();
    let mut notes = Vec::new();
    if info.interlaced {
        match ["bwdif", "yadif"].into_iter().find(|name| has(name)) {
            Some(name) => {
                filters.push(format!("{name}=mode=send_frame"));
                notes.push("it is interlaced: each frame was made from the lines of one time".to_owned());
            }
            None => notes.push(
                "it is interlaced, and this ffmpeg has no filter `bwdif` or `yadif`: moving edges have combs"
                    .to_owned(),
            ),
        }
    }
    // Frames are chosen before they are scaled, and scaled before their tones are mapped, which takes longest.
    match wanted.pace {
        Pace::All => {}
        Pace::FirstOfEach(rate) => {
            // A frame is taken where it is the first one of its stretch of time. The small number is for rounding.
            let stretch = |time: &str| format!("floor(({time}-start_t)*{rate}+0.001)");
            let (now, before) = (stretch("t"), stretch("prev_selected_t"));
            filters.push(format!("select='isnan(prev_selected_t)+gt({now}\\,{before})'"));
        }
        Pace::Resampled(rate) => filters.push(format!("fps={rate}")),
    }
    let tones = info.hdr.filter(|_| has("zscale") && has("tonemap"));
    // `sar` is the width of a pixel; 1 where it is not known.
    let width = match wanted.max_width {
        Some(most) => format!("max(1,trunc(min({most},iw*sar)))"),
        None => "max(1,trunc(iw*sar))".to_owned(),
    };
    let scale = format!("scale=w='{width}':h='max(1,trunc(ow*ih/(iw*sar)+0.5))':flags=lanczos");
    // The colors of a JPEG file are those of BT.601 in the full range, whatever those of the video are.
    let jpeg = ":out_color_matrix=bt601:out_range=pc";
    let jpeg = if wanted.jpeg { jpeg } else { "" };
    filters.push(if tones.is_some() { scale } else { format!("{scale}{jpeg}") });
    filters.push("setsar=1".to_owned());
    if let Some(hdr) = tones {
        filters.push(format!("zscale=tin={}:min=2020_ncl:pin=2020:t=linear:npl={WHITE}", hdr.transfer()));
        filters.push("format=gbrpf32le,zscale=p=709".to_owned());
        filters.push(format!("tonemap=mobius:desat=0:peak={:.3}", BRIGHTEST / WHITE));
        filters.push("zscale=t=709:m=709:r=tv,format=yuv444p".to_owned());
        // Without an option this filter would not convert.
        filters.push(format!("scale=in_color_matrix=bt709{jpeg}"));
        notes.push(format!("it has a high dynamic range ({}): its tones were mapped to the usual range", hdr.name()));
    } else if let Some(hdr) = info.hdr {
        notes.push(format!(
            "it has a high dynamic range ({}), and this ffmpeg has no filters `zscale` and `tonemap`: its tones were not \
             mapped, so frames look pale; film without HDR, or install an ffmpeg with libzimg",
            hdr.name()
        ));
    }
    if let Some((width, height)) = info.pixel {
        notes.push(format!("its pixels are {width}:{height}: frames were scaled to square ones"));
    }
    // Prints a line for each frame, with its time.
    filters.push("showinfo".to_owned());
    Chain { filters: filters.join(","), notes }
}

#[cfg(test)]
mod tests {
    use super::super::info::Hdr;
    use super::*;

    #[test]
    fn filters_follow_from_the_video_and_the_build() {
        let wanted = Wanted { max_width: Some(800), pace: Pace::All, count: None, jpeg: true };
        let plain = build(&VideoInfo::default(), &wanted, &|_| false);
        assert!(plain.notes.is_empty() && !plain.filters.contains("zscale") && !plain.filters.contains("bwdif"));
        assert!(plain.filters.contains("min(800,iw*sar)") && plain.filters.ends_with("showinfo"), "{}", plain.filters);
        let info = VideoInfo { hdr: Some(Hdr::Hlg), interlaced: true, pixel: Some((2, 1)), ..VideoInfo::default() };
        let all = build(&info, &wanted, &|_| true);
        let place = |word: &str| all.filters.find(word).unwrap_or_else(|| panic!("{word}: {}", all.filters));
        assert!(place("bwdif") < place("min(800") && place("min(800") < place("tin=arib-std-b67"), "{}", all.filters);
        assert_eq!(all.notes.len(), 3);
        let poor = build(&info, &wanted, &|name| name == "yadif");
        assert!(poor.filters.starts_with("yadif=") && !poor.filters.contains("zscale"), "{}", poor.filters);
        assert!(poor.notes[1].contains("were not mapped"), "{:?}", poor.notes);
        assert!(build(&info, &wanted, &|_| false).notes[0].contains("combs"));
    }
}
