//! Points and lines over two axes.

use std::error::Error;
use std::ops::Range;

use plotters::backend::DrawingBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::element::{Circle, PathElement, Text};
use plotters::prelude::DrawingArea;
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{BLACK, Color, IntoFont, ShapeStyle, WHITE};

use super::{FONT, Plot, color, pale};

/// Width of the legend in pixels.
const LEGEND: i32 = 250;
/// Longer labels are cut.
const MOST_LETTERS: usize = 30;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Points alone.
    Points,
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// A line through points.
    LinePoints,
}

/// Some points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its label in the legend.
    pub label: String,
    /// How they are drawn.
    pub mark: Mark,
    /// x and y; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// Series over two axes.
#[derive(Clone, Debug)]
pub struct ScatterPlot {
    /// The heading.
    pub title: String,
    /// The label of the x axis, with the unit.
    pub x_label: String,
    /// The label of the y axis, with the unit.
    pub y_label: String,
    /// Whether x is drawn by its logarithm; then points whose x is not above 0 are left out.
    pub logarithmic: bool,
    /// In the order of the colors.
    pub series: Vec<Series>,
    /// Lines across the plot: label and y.
    pub levels: Vec<(String, f64)>,
}

impl ScatterPlot {
    fn points(&self, series: &Series) -> Vec<(f64, f64)> {
        let place = |&(x, y): &(f64, f64)| {
            let x = if self.logarithmic { x.ln() } else { x };
            (x.is_finite() && y.is_finite()).then_some((x, y))
        };
        series.points.iter().filter_map(place).collect()
    }
}

impl Plot for ScatterPlot {
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), Box<dyn Error>>
    where
        B::ErrorType: 'static,
    {
        let all: Vec<(f64, f64)> = self.series.iter().flat_map(|series| self.points(series)).collect();
        let levels: Vec<_> = self.levels.iter().filter(|(_, y)| y.is_finite()).collect();
        let x = range(all.iter().map(|(x, _)| *x));
        let y = range(all.iter().map(|(_, y)| *y).chain(levels.iter().map(|(_, y)| *y)));
        let ticks = if self.logarithmic { logarithmic_ticks(x) } else { linear_ticks(x) };
        let (plot, legend) = area.split_horizontally(area.dim_in_pixel().0 as i32 - LEGEND);
        let mut builder = ChartBuilder::on(&plot);
        builder.caption(&self.title, (FONT, 20).into_font()).margin(12).x_label_area_size(44).y_label_area_size(64);
        let mut chart = builder.build_cartesian_2d(TickedAxis { range: x, ticks }, y.0..y.1)?;
        let label = |x: &f64| short(if self.logarithmic { x.exp() } else { *x });
        chart
            .configure_mesh()
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_label_formatter(&label)
            .y_label_formatter(&|y| short(*y))
            .label_style((FONT, 13))
            .axis_desc_style((FONT, 14))
            .light_line_style(WHITE)
            .draw()?;
        for (index, series) in self.series.iter().enumerate() {
            let points = self.points(series);
            let line = LineSeries::new(points.clone(), stroke(series.mark, index));
            match series.mark {
                Mark::Line | Mark::LinePoints => {
                    chart.draw_series(line)?;
                }
                Mark::Dashed => {
                    chart.draw_series(DashedLineSeries::new(points.clone(), 6, 4, stroke(series.mark, index)))?;
                }
                Mark::Points => {}
            }
            if matches!(series.mark, Mark::Points | Mark::LinePoints) {
                chart.draw_series(points.iter().map(|point| Circle::new(*point, 4, color(index).filled())))?;
            }
        }
        for (index, (_, level)) in levels.iter().enumerate() {
            let ends = [(x.0, *level), (x.1, *level)];
            chart.draw_series(DashedLineSeries::new(ends, 2, 4, stroke(Mark::Dashed, index)))?;
        }
        let series = self.series.iter().enumerate().map(|(index, series)| (&series.label, series.mark, index));
        let levels = levels.iter().enumerate().map(|(index, (label, _))| (label, Mark::Dashed, index));
        draw_legend(&legend, series.chain(levels))
    }
}

/// The line of a series, or of a level.
fn stroke(mark: Mark, index: usize) -> ShapeStyle {
    let style = if mark == Mark::Dashed { ShapeStyle::from(pale(index)) } else { ShapeStyle::from(color(index)) };
    style.stroke_width(2)
}

/// Beside the plot, where it covers nothing.
fn draw_legend<'a, B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    entries: impl Iterator<Item = (&'a String, Mark, usize)>,
) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    for (row, (label, mark, index)) in entries.enumerate() {
        let y = 50 + 22 * row as i32;
        match mark {
            Mark::Points => area.draw(&Circle::new((12, y), 4, color(index).filled()))?,
            Mark::Dashed => {
                for x in [0, 10, 20] {
                    area.draw(&PathElement::new(vec![(x, y), (x + 5, y)], stroke(mark, index)))?;
                }
            }
            Mark::Line | Mark::LinePoints => {
                area.draw(&PathElement::new(vec![(0, y), (24, y)], stroke(mark, index)))?;
            }
        }
        let mut text: String = label.chars().take(MOST_LETTERS).collect();
        if text.len() < label.len() {
            text.push_str("...");
        }
        area.draw(&Text::new(text, (32, y - 7), (FONT, 13).into_font().color(&BLACK)))?;
    }
    Ok(())
}

/// A linear axis with ticks of our choice.
struct TickedAxis {
    range: (f64, f64),
    ticks: Vec<f64>,
}

impl Ranged for TickedAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.0) / (self.range.1 - self.range.0);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.0..self.range.1
    }
}

/// From the least to the most value, with a margin; a default range if there are no values.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
    if least > most {
        return (0.0, 1.0);
    }
    let margin = 0.05 * (most - least);
    // Values that differ only by rounding are one value.
    if margin > 1e-9 * least.abs().max(most.abs()) && margin.is_normal() {
        (least - margin, most + margin)
    } else {
        let margin = 0.1 * least.abs().max(1e-3);
        (least - margin, most + margin)
    }
}

/// 1, 2 and 5 times powers of ten, as logarithms, at most about twelve; over a short range, those of a linear axis.
fn logarithmic_ticks((low, high): (f64, f64)) -> Vec<f64> {
    let powers = (low / std::f64::consts::LN_10).floor() as i32..=(high / std::f64::consts::LN_10).ceil() as i32;
    let ticks = |factors: &[f64]| -> Vec<f64> {
        let all = powers.clone().flat_map(|power| {
            factors.iter().map(move |factor| factor.ln() + f64::from(power) * std::f64::consts::LN_10)
        });
        all.filter(|tick| (low..=high).contains(tick)).collect()
    };
    let fine = ticks(&[1.0, 2.0, 5.0]);
    match fine.len() {
        0..=2 => linear_ticks((low.exp(), high.exp())).into_iter().map(f64::ln).collect(),
        3..=12 => fine,
        _ => ticks(&[1.0]),
    }
}

/// About eight multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks((low, high): (f64, f64)) -> Vec<f64> {
    let least = ((high - low) / 8.0).max(f64::MIN_POSITIVE);
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= least);
    let step = step.unwrap_or(10.0 * power);
    (0..20).map(|index| ((low / step).ceil() + f64::from(index)) * step).take_while(|tick| *tick <= high).collect()
}

/// With as many digits as a tick needs.
fn short(value: f64) -> String {
    let size = value.abs();
    let text = if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.4}")
    };
    let trimmed = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if trimmed == "-0" { "0".to_owned() } else { trimmed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        let ticks = |low: f64, high: f64| -> Vec<String> {
            logarithmic_ticks((low.ln(), high.ln())).into_iter().map(|tick| short(tick.exp())).collect()
        };
        assert_eq!(ticks(0.09, 3.9), ["0.1", "0.2", "0.5", "1", "2"]);
        assert_eq!(ticks(0.0977, 0.195), ["0.1", "0.12", "0.14", "0.16", "0.18"]);
        assert_eq!(ticks(0.9e-6, 1.1e6).len(), 13);
    }
}
