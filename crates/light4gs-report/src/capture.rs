//! What a capture is taken for: a section of the report, and the page of `light4gs check`.

use std::fmt::Write as _;
use std::path::Path;

use glam::Vec3;
use light4gs_data::{CameraCurve, CaptureSummary, DataError, Frame, RgbImage8, Scene};

use super::chart::{Chart, Mark, Series};
use super::html::escape;
use super::images::data_uri;
use super::page_of;

/// Points and cameras that are drawn, of more of them.
const MOST_POINTS: usize = 3000;
const MOST_CAMERAS: usize = 300;
/// Side of the drawing.
const SIDE: f32 = 520.0;
/// Cameras whose curves are drawn in one chart, which has three colors.
const CURVES_A_CHART: usize = 3;
/// Charts of curves, at most.
const MOST_CHARTS: usize = 8;

/// The facts, notes and problems.
pub(super) fn section(capture: &CaptureSummary) -> String {
    if capture.facts.is_empty() {
        return String::new();
    }
    let mut html = String::from("<table>\n");
    for fact in &capture.facts {
        let (what, found) = (escape(&fact.what), escape(&fact.found));
        let _ = writeln!(html, "<tr><th scope=\"row\">{what}</th><td>{found}</td></tr>");
    }
    html.push_str("</table>\n");
    for (kind, texts) in [("Problem", &capture.problems), ("Advice", &capture.faults), ("Note", &capture.notes)] {
        for text in texts {
            let _ = writeln!(html, "<p><b>{kind}:</b> {}</p>", escape(text));
        }
    }
    html
}

/// A page about a capture that is not trained yet: facts, cameras and points from above, `images` with their names, and
/// for each camera how much its images change, and how sharp they are.
///
/// # Errors
/// [`DataError::Image`] if an image cannot be written as PNG.
pub fn capture_page(
    scene: &Scene,
    capture: &CaptureSummary,
    curves: &[CameraCurve],
    images: &[(String, RgbImage8)],
) -> Result<String, DataError> {
    let sections = [
        ("What was understood", section(capture)),
        ("Cameras and points from above", from_above(scene)),
        ("Images", contact_sheet(images)?),
        ("Change from one image to the next", charts("Mean difference of gray values", curves, |curve| &curve.changes)),
        ("Sharpness", charts("Detail at the size at which images are used", curves, |curve| &curve.sharpness)),
    ];
    let sections = sections.into_iter().filter(|(_, html)| !html.is_empty());
    let sections: Vec<(String, String)> = sections.map(|(heading, html)| (heading.to_owned(), html)).collect();
    Ok(page_of(&scene.name, &scene.root.display().to_string(), &sections))
}

/// What each camera's images are like over time: `values` of a curve, the last of which belongs to its last image.
fn charts(title: &str, curves: &[CameraCurve], values: impl Fn(&CameraCurve) -> &[f32]) -> String {
    let series = |curve: &CameraCurve| {
        let values = values(curve);
        let times = &curve.times[curve.times.len() - values.len()..];
        let points = times.iter().zip(values).filter(|(_, value)| value.is_finite());
        let points = points.map(|(time, value)| ((*time).into(), (*value).into())).collect();
        Series { label: curve.name.clone(), mark: Mark::Line, points }
    };
    let chart = |group: &[CameraCurve]| Chart {
        title: title.to_owned(),
        x_label: "time".to_owned(),
        series: group.iter().map(series).collect(),
        logarithmic: false,
        from_zero: true,
        border: None,
    };
    curves.chunks(CURVES_A_CHART).take(MOST_CHARTS).map(|group| chart(group).to_svg()).collect()
}

fn contact_sheet(images: &[(String, RgbImage8)]) -> Result<String, DataError> {
    let mut html = String::new();
    for (name, image) in images {
        let unwritable = |error: image::ImageError| {
            DataError::image(
                Path::new(name),
                format!("cannot become a PNG: {error}"),
                "please report this fault of the program",
            )
        };
        let (data, name) = (data_uri(image).map_err(unwritable)?, escape(name));
        let (width, height) = (image.width, image.height);
        let _ = writeln!(
            html,
            "<figure class=\"thumbnail\"><img src=\"{data}\" alt=\"{name}\" width=\"{width}\" height=\"{height}\">\
             <figcaption>{name}</figcaption></figure>"
        );
    }
    Ok(if html.is_empty() { html } else { format!("<div class=\"sheet\">\n{html}</div>\n") })
}

/// A plan of the scene: the cameras' mean upwards is up, and one unit is the same length both ways.
fn from_above(scene: &Scene) -> String {
    let frames = |frames: &[Frame]| -> Vec<(Vec3, Vec3)> {
        let chosen = frames.iter().step_by(frames.len().div_ceil(MOST_CAMERAS).max(1));
        chosen.map(|frame| (frame.camera.center(), frame.camera.rotation.row(2))).collect()
    };
    let up: Vec3 = scene.train.iter().map(|frame| -frame.camera.rotation.row(1)).sum();
    let up = up.try_normalize().unwrap_or(Vec3::Z);
    let (across, along) = up.any_orthonormal_pair();
    let plan = |point: Vec3| (point.dot(across), point.dot(along));
    let points = &scene.points;
    let step = points.len().div_ceil(MOST_POINTS).max(1);
    let dots: Vec<((f32, f32), [f32; 3])> =
        (0..points.len()).step_by(step).map(|i| (plan(Vec3::from(points.positions[i])), points.colors[i])).collect();
    let (train, test) = (frames(&scene.train), frames(&scene.test));
    let cameras = || train.iter().chain(&test).map(|(center, _)| plan(*center));
    let place = Frame2d::around(dots.iter().map(|(dot, _)| *dot), cameras());
    let mut svg = String::new();
    for (dot, color) in &dots {
        let (x, y) = place.of(*dot);
        let [r, g, b] = color.map(|value| (255.0 * value) as u8);
        let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.2\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>");
    }
    for (class, cameras) in [("s0", &train), ("s1", &test)] {
        for (center, axis) in cameras {
            let ((x, y), (to_x, to_y)) = (place.of(plan(*center)), place.of(plan(*center + *axis * place.length)));
            let _ = write!(
                svg,
                "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>\
                 <line class=\"{class}\" x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{to_x:.1}\" y2=\"{to_y:.1}\"/>"
            );
        }
    }
    format!(
        "<figure class=\"plan\"><figcaption><span class=\"key s0\">cameras to train on</span><span class=\"key s1\">cameras to \
         test</span></figcaption>\n<svg viewBox=\"0 0 {SIDE} {SIDE}\" role=\"img\" aria-label=\"{} cameras and {} points from \
         above\">{svg}</svg></figure>\n",
        scene.train.len() + scene.test.len(),
        points.len()
    )
}

/// From the plane of the plan to the drawing.
struct Frame2d {
    middle: (f32, f32),
    /// Pixels a unit.
    scale: f32,
    /// Length of a camera's line, world units.
    length: f32,
}

impl Frame2d {
    /// Shows all cameras, and all points but the outermost.
    fn around(points: impl Iterator<Item = (f32, f32)>, cameras: impl Iterator<Item = (f32, f32)>) -> Self {
        let (mut x, mut y): (Vec<f32>, Vec<f32>) = points.unzip();
        let cut = |values: &mut Vec<f32>| {
            values.sort_by(f32::total_cmp);
            let margin = values.len() / 50;
            let kept = values.len() - margin;
            values.truncate(kept);
            values.drain(..margin.min(values.len()));
        };
        cut(&mut x);
        cut(&mut y);
        for (camera_x, camera_y) in cameras {
            x.push(camera_x);
            y.push(camera_y);
        }
        let range = |values: &[f32]| {
            let least = values.iter().copied().fold(f32::INFINITY, f32::min);
            (least, values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
        };
        let ((left, right), (low, high)) = (range(&x), range(&y));
        let extent = (right - left).max(high - low).max(1e-6) * 1.1;
        Self { middle: ((left + right) / 2.0, (low + high) / 2.0), scale: SIDE / extent, length: extent / 20.0 }
    }

    fn of(&self, (x, y): (f32, f32)) -> (f32, f32) {
        (SIDE / 2.0 + (x - self.middle.0) * self.scale, SIDE / 2.0 - (y - self.middle.1) * self.scale)
    }
}
