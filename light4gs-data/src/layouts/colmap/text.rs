//! COLMAP's text files: `cameras.txt`, `images.txt`, `points3D.txt`.

use super::model::{ModelCamera, ModelImage, ModelPoints, REMEDY, model_of_name, unknown_model};
use crate::error::DataError;
use crate::layouts::shared::files::shorten;
use crate::regular_file::read_regular_text;
use std::collections::HashMap;
use std::path::Path;
use std::str::FromStr;

/// As text they are larger than in binary.
const MAX_BYTES: u64 = 8 << 30;

fn read(path: &Path) -> Result<String, DataError> {
    read_regular_text(path, MAX_BYTES).map_err(DataError::io("read", path))
}

/// The words of a line, with its number for messages.
struct Line<'a> {
    path: &'a Path,
    number: usize,
    words: Vec<&'a str>,
}

impl Line<'_> {
    fn error(&self, problem: String) -> DataError {
        DataError::field(self.path, format!("line {}", self.number), problem, REMEDY)
    }

    fn field(&self) -> String {
        format!("line {}", self.number)
    }

    fn at_least(self, count: usize, layout: &str) -> Result<Self, DataError> {
        if self.words.len() < count {
            return Err(self.error(format!("{} words, expected {layout}", self.words.len())));
        }
        Ok(self)
    }

    fn parse<T: FromStr>(&self, i: usize, what: &str) -> Result<T, DataError> {
        let word = self.words[i];
        word.parse().map_err(|_| self.error(format!("`{}` stands where {what} is expected", shorten(word))))
    }

    fn floats<const N: usize>(&self, from: usize) -> Result<[f64; N], DataError> {
        let mut out = [0.0; N];
        for (i, value) in out.iter_mut().enumerate() {
            *value = self.parse(from + i, "a number")?;
        }
        Ok(out)
    }
}

/// Lines without comments, with their numbers from 1.
fn lines<'a>(path: &'a Path, text: &'a str) -> impl Iterator<Item = (&'a str, Line<'a>)> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.starts_with('#'))
        .map(move |(i, line)| (line, Line { path, number: i + 1, words: line.split_whitespace().collect() }))
}

pub(super) fn cameras(path: &Path) -> Result<HashMap<u32, ModelCamera>, DataError> {
    let text = read(path)?;
    let mut cameras = HashMap::new();
    for (_, line) in lines(path, &text).filter(|(_, line)| !line.words.is_empty()) {
        let line = line.at_least(5, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]")?;
        let id = line.parse(0, "the number of a camera")?;
        let (model, parameters) =
            model_of_name(line.words[1]).ok_or_else(|| unknown_model(path, &line.field(), &shorten(line.words[1])))?;
        let size = (line.parse(2, "a width")?, line.parse(3, "a height")?);
        let given = line.words.len() - 4;
        if given != parameters {
            return Err(line.error(format!("{given} parameters, expected {parameters} for {model}")));
        }
        let values = (4..4 + parameters).map(|i| line.parse(i, "a number")).collect::<Result<Vec<f64>, _>>()?;
        cameras.insert(id, ModelCamera::new(path, &line.field(), model, size, &values)?);
    }
    Ok(cameras)
}

/// An image takes two lines: the pose, and its keypoints. The second may be empty.
pub(super) fn images(path: &Path) -> Result<Vec<ModelImage>, DataError> {
    let text = read(path)?;
    let mut images = Vec::new();
    let mut all = lines(path, &text);
    while let Some((whole, line)) = all.next() {
        if line.words.is_empty() {
            continue;
        }
        let line = line.at_least(10, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME")?;
        let camera = line.parse(8, "the number of a camera")?;
        // A name may contain spaces: it is everything after the ninth word.
        let name = (0..9)
            .fold(whole, |rest, _| rest.trim_start().split_once(char::is_whitespace).map_or("", |(_, rest)| rest));
        let name = name.trim().to_owned();
        images.push(ModelImage::new(path, &line.field(), name, line.floats(1)?, line.floats(5)?, camera)?);
        if let Some((_, keypoints)) = all.next() {
            check_keypoints(&keypoints)?;
        }
    }
    Ok(images)
}

/// The second line of an image: coordinates and the number of a point, in groups of three. If a program leaves this
/// line out, every other image would be lost.
fn check_keypoints(line: &Line) -> Result<(), DataError> {
    let is_point = |words: &[&str]| words.len() == 3 && words[2].parse::<i64>().is_ok();
    if line.words.chunks(3).all(is_point) {
        return Ok(());
    }
    let remedy = "write two lines for each image; the second may be empty";
    let problem = "keypoints `X Y POINT3D_ID` are expected in the line after an image";
    Err(DataError::field(line.path, line.field(), problem, remedy))
}

/// The points. Those that are not finite are counted and left out.
pub(super) fn points(path: &Path) -> Result<ModelPoints, DataError> {
    let text = read(path)?;
    let mut points = ModelPoints::default();
    for (_, line) in lines(path, &text).filter(|(_, line)| !line.words.is_empty()) {
        let line = line.at_least(8, "POINT3D_ID X Y Z R G B ERROR TRACK[]")?;
        let [x, y, z, r, g, b, error] = line.floats(1)?;
        let position = [x, y, z].map(|v| v as f32);
        if position.iter().all(|v| v.is_finite()) {
            points.cloud.positions.push(position);
            points.cloud.colors.push([r, g, b].map(|v| (v / 255.0).clamp(0.0, 1.0) as f32));
            points.errors += error;
        } else {
            points.not_finite += 1;
        }
    }
    Ok(points)
}
