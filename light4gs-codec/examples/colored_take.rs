//! Makes a take for tests of players: colored_take OUT SEGMENTS [SCENE], and makes it longer: colored_take --append FILE
//! [SCENE].
//!
//! A segment takes a second, and has one of six colors. The base has a large white ball in the middle, which all segments hide, and gray
//! balls around it. So the middle of an image tells which segment is shown, and white says that none is. A last second has no segment. With SCENE each
//! segment is this stream, and has no color of its own; without, it is some balls in one place.

use std::{path::Path, process::ExitCode};

use light4gs_codec::{
    GaussianArrays, SceneData, SceneMeta, encode, info,
    take::{NewSegment, SegmentTimes, Take, TakeFile, TakeMeta, write_take},
};

/// The most common colors of a screen.
const COLORS: [[f32; 3]; 6] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]];
const FPS: f32 = 30.0;
/// Seconds of a segment's stream before and after what is shown.
const MARGIN: f64 = 0.25;
/// Gray balls of the base.
const RING: usize = 60;
/// Balls that a segment has more than the one before, up to the fourth.
const MORE: usize = 100;
/// Slots of the index beyond those of the segments.
const SPARE_SLOTS: u32 = 1;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let made = match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--append", file, scene @ ..] => append(Path::new(file), scene.first()),
        [out, segments, scene @ ..] => make(out, segments, scene.first()),
        _ => {
            eprintln!("usage: colored_take OUT SEGMENTS [SCENE]; colored_take --append FILE [SCENE]");
            return ExitCode::from(64);
        }
    };
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn make(out: &str, segments: &str, scene: Option<&&str>) -> Result<(), String> {
    let count: u16 = segments.parse().map_err(|error| format!("{segments}: {error}"))?;
    let segments = (0..count).map(|number| segment(number, scene)).collect::<Result<Vec<_>, _>>()?;
    let meta = TakeMeta { name: "colors".into(), fps: FPS, seconds: f64::from(count) + 1.0, ..TakeMeta::default() };
    let bytes = write_take(&meta, &base()?, &segments, SPARE_SLOTS).map_err(|error| error.to_string())?;
    std::fs::write(out, bytes).map_err(|error| error.to_string())
}

fn append(path: &Path, scene: Option<&&str>) -> Result<(), String> {
    let take = Take::open(path, &light4gs_codec::Limits::default()).map_err(|error| error.to_string())?;
    let next = segment(take.len() as u16, scene)?;
    TakeFile::append(path, &next).map_err(|error| error.to_string())
}

/// The white ball, and the gray ones around it.
fn base() -> Result<Vec<u8>, String> {
    let white = ([0.0; 3], 0.25, [1.0; 3]);
    let ring = (0..RING).map(|index| {
        let (sin, cos) = (index as f32 * std::f32::consts::TAU / RING as f32).sin_cos();
        ([cos, sin, 0.0], 0.04, [0.5; 3])
    });
    let gaussians = balls(std::iter::once(white).chain(ring));
    let meta = SceneMeta { bounds: [[-1.2; 3], [1.2; 3]], width: 400, height: 400, fov_x: 0.7, ..SceneMeta::default() };
    encode(&SceneData { meta, gaussians, ..SceneData::default() }).map_err(|error| error.to_string())
}

fn segment(number: u16, scene: Option<&&str>) -> Result<NewSegment, String> {
    let color = COLORS[usize::from(number) % COLORS.len()];
    let stream = match scene {
        None => {
            let gaussians = balls(vec![([0.0; 3], 0.25, color); 1 + MORE * usize::from(number % 4)]);
            encode(&SceneData { gaussians, ..SceneData::default() }).map_err(|error| error.to_string())?
        }
        Some(file) => std::fs::read(file).map_err(|error| format!("{file}: {error}"))?,
    };
    let begin = f64::from(number);
    let times = SegmentTimes {
        begin,
        end: begin + 1.0,
        stream_begin: begin - MARGIN,
        stream_end: begin + 1.0 + MARGIN,
        frames: 45,
    };
    let hidden =
        (0..info(&base()?).map_err(|error| error.to_string())?.gaussian_count).map(|index| index == 0).collect();
    Ok(NewSegment { times, stream, hidden })
}

/// Opaque balls: center, radius, color. They are not quite round: some renderers lose a round Gaussian in the middle of the view.
fn balls(balls: impl IntoIterator<Item = ([f32; 3], f32, [f32; 3])>) -> GaussianArrays {
    let mut gaussians = GaussianArrays::default();
    for (mean, radius, color) in balls {
        gaussians.means.push(mean);
        gaussians.log_scales.push([radius, 0.8 * radius, 0.9 * radius].map(f32::ln));
        gaussians.quats.push([1.0, 0.0, 0.0, 0.0]);
        gaussians.opacity_logits.push(6.0);
        gaussians.sh_dc.push(constant(color));
    }
    gaussians
}

/// The coefficients of degree 0 of a color.
fn constant(color: [f32; 3]) -> [f32; 3] {
    color.map(|value| (value - 0.5) / 0.282_094_8)
}
