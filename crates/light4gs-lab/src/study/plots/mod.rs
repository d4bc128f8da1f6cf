//! Plots of a study, each as SVG and as PNG, drawn by the same code.
//!
//! PNG needs a font. A subset of DejaVu Sans is embedded (`DejaVuSans-subset.ttf`, whose license allows that, see
//! `DejaVuSans.license`), so that no library and no font of the system is needed.

mod bars;
mod scatter;

use std::error::Error;
use std::sync::Once;

use light4gs_data::RgbImage8;
use light4gs_train::error::TrainError;
use plotters::backend::DrawingBackend;
use plotters::coord::Shift;
use plotters::prelude::{BitMapBackend, DrawingArea, IntoDrawingArea, SVGBackend};
use plotters::style::{Color, FontStyle, RGBColor, WHITE, register_font};

pub use bars::{Bar, BarPlot};
pub use scatter::{Mark, ScatterPlot, Series};

const SIZE: (u32, u32) = (900, 540);
const FONT: &str = "sans-serif";
static FONT_DATA: &[u8] = include_bytes!("DejaVuSans-subset.ttf");

/// Distinguishable for color-blind readers, too (Okabe and Ito 2008).
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// A plot in both forms.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// As SVG.
    pub svg: String,
    /// As pixels.
    pub image: RgbImage8,
}

/// Something that can be drawn.
pub trait Plot {
    /// Draws onto an empty area.
    ///
    /// # Errors
    /// An error of the drawing back end.
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), Box<dyn Error>>
    where
        B::ErrorType: 'static;

    /// Width and height in pixels.
    fn size(&self) -> (u32, u32) {
        SIZE
    }
}

/// Draws a plot in both forms.
///
/// # Errors
/// [`TrainError::Input`] if it cannot be drawn.
pub fn draw(plot: &impl Plot) -> Result<Drawing, TrainError> {
    static REGISTERED: Once = Once::new();
    // If the font is not registered, an error follows below.
    REGISTERED.call_once(|| drop(register_font(FONT, FontStyle::Normal, FONT_DATA)));
    let failed = |error: Box<dyn Error>| TrainError::Input(format!("a plot cannot be drawn: {error}"));
    let (width, height) = plot.size();
    let mut svg = String::new();
    on(SVGBackend::with_string(&mut svg, (width, height)), plot).map_err(failed)?;
    let mut pixels = vec![0; width as usize * height as usize * 3];
    on(BitMapBackend::with_buffer(&mut pixels, (width, height)), plot).map_err(failed)?;
    Ok(Drawing { svg, image: RgbImage8 { width, height, pixels } })
}

fn on<B: DrawingBackend>(back_end: B, plot: &impl Plot) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let area = back_end.into_drawing_area();
    area.fill(&WHITE)?;
    plot.draw(&area)?;
    area.present()?;
    Ok(())
}

fn color(index: usize) -> RGBColor {
    COLORS[index % COLORS.len()]
}

/// A paler color, for the background.
fn pale(index: usize) -> plotters::style::RGBAColor {
    color(index).mix(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn has_ink(drawing: &Drawing) -> bool {
        drawing.image.pixels.chunks_exact(3).any(|pixel| pixel != [255; 3])
    }

    #[test]
    fn plots_of_anything_can_be_drawn() {
        let series =
            |points: &[(f64, f64)], mark| Series { label: "a & <b> −±Δ".into(), mark, points: points.to_vec() };
        let cases: &[&[(f64, f64)]] = &[
            &[],
            &[(1.0, 2.0)],
            &[(1.0, 2.0), (1.0, 2.0)],
            &[(0.1, 20.0), (4e6, 30.0), (20.0, 25.0)],
            &[(f64::NAN, 1.0), (1.0, f64::INFINITY)],
            &[(0.0, -1.0), (5.0, 1e-12)],
        ];
        for points in cases {
            for logarithmic in [false, true] {
                let marks = [Mark::Points, Mark::Line, Mark::Dashed, Mark::LinePoints];
                let plot = ScatterPlot {
                    title: "Title".into(),
                    x_label: "x".into(),
                    y_label: "y".into(),
                    logarithmic,
                    series: marks.map(|mark| series(points, mark)).into(),
                    levels: vec![("level".into(), 22.0)],
                };
                let drawing = draw(&plot).unwrap();
                assert!(has_ink(&drawing) && drawing.svg.contains("&amp;"), "{points:?}");
            }
        }
    }

    #[test]
    fn bars_of_anything_can_be_drawn() {
        for values in [vec![], vec![0.0, 0.0], vec![1.0, 2.0], vec![f64::NAN, 3e9]] {
            let bars = (0..values.len().max(1)).map(|_| Bar { label: "long label ".repeat(9), values: values.clone() });
            let parts = (0..values.len()).map(|part| format!("part {part}")).collect();
            let plot = BarPlot { title: "Title".into(), unit: "bytes".into(), parts, bars: bars.collect() };
            assert!(has_ink(&draw(&plot).unwrap()));
        }
        let empty = BarPlot { title: "none".into(), unit: String::new(), parts: vec![], bars: vec![] };
        assert!(has_ink(&draw(&empty).unwrap()));
    }
}
