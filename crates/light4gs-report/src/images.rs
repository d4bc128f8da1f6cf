//! Ground truth, render and error of some views, side by side.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use light4gs_data::{DataError, RgbImage8};
use light4gs_train::evaluation::RenderedView;

use super::color_map::{css_gradient, inferno};
use super::format::fixed;
use super::html::escape;

/// Error that gets the brightest color. One scale for all views, so that they can be compared. In a good rendering,
/// errors reach 0.2 only along edges.
const BRIGHTEST_ERROR: f32 = 0.2;

pub(super) fn section(path: &Path, views: &[RenderedView]) -> Result<String, DataError> {
    if views.is_empty() {
        return Ok(String::new());
    }
    let mut html = format!(
        "<p class=\"legend\">Error: mean difference of the color channels, \
         <span class=\"scale\">0 <i style=\"background:{}\"></i> {BRIGHTEST_ERROR} and more</span></p>\n<div class=\"views\">\n",
        css_gradient()
    );
    for view in views {
        figure(&mut html, path, view)?;
    }
    html.push_str("</div>\n");
    Ok(html)
}

fn figure(html: &mut String, path: &Path, view: &RenderedView) -> Result<(), DataError> {
    let name = format!("{} {}", view.split, view.name);
    let wrong = |problem: String| DataError::Image {
        path: path.to_path_buf(),
        problem: format!("view {name}: {problem}"),
        remedy: "this is a fault of the program: please report it".to_owned(),
    };
    let error = error_map(&view.truth, &view.render).map_err(&wrong)?;
    let name = escape(&name);
    let psnr = fixed(view.psnr, 2);
    let _ = write!(
        html,
        "<figure>\n<figcaption><b>{name}</b> <span>time {}</span> <span>{psnr} dB</span>\
         <button type=\"button\" class=\"compare\" hidden>Compare</button></figcaption>\n<div class=\"triple\">\n",
        fixed(view.time.into(), 3)
    );
    for (kind, image) in [("Ground truth", &view.truth), ("Render", &view.render), ("Error", &error)] {
        let data = data_uri(image).map_err(|error| wrong(error.to_string()))?;
        let alt = match kind {
            "Error" => format!("Error of {name}: PSNR {psnr} dB"),
            _ => format!("{kind} of {name}"),
        };
        let (width, height) = (image.width, image.height);
        let _ = writeln!(
            html,
            "<div><img src=\"{data}\" alt=\"{alt}\" width=\"{width}\" height=\"{height}\"><span>{kind}</span></div>"
        );
    }
    html.push_str("</div>\n</figure>\n");
    Ok(())
}

fn error_map(truth: &RgbImage8, render: &RgbImage8) -> Result<RgbImage8, String> {
    let (width, height) = (truth.width, truth.height);
    let bytes = u64::from(width) * u64::from(height) * 3;
    if bytes == 0 || truth.pixels.len() as u64 != bytes {
        return Err(format!("{width}x{height} pixels with {} bytes of ground truth", truth.pixels.len()));
    }
    if (render.width, render.height, render.pixels.len()) != (width, height, truth.pixels.len()) {
        return Err(format!("a render of {}x{} pixels for {width}x{height}", render.width, render.height));
    }
    let pairs = truth.pixels.chunks_exact(3).zip(render.pixels.chunks_exact(3));
    let pixels = pairs
        .flat_map(|(truth, render)| {
            let sum: u32 = truth.iter().zip(render).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
            inferno(sum as f32 / (3.0 * 255.0) / BRIGHTEST_ERROR)
        })
        .collect();
    Ok(RgbImage8 { width, height, pixels })
}

/// The image as the address of a PNG that is embedded in the page: `data:image/png;base64,...`.
///
/// # Errors
/// An image without pixels.
pub fn data_uri(image: &RgbImage8) -> image::ImageResult<String> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(&image.pixels, image.width, image.height, ExtendedColorType::Rgb8)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}
