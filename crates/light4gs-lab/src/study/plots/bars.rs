//! Stacked bars of several parts.

use std::error::Error;

use plotters::backend::DrawingBackend;
use plotters::coord::Shift;
use plotters::element::{Rectangle, Text};
use plotters::prelude::DrawingArea;
use plotters::style::{BLACK, Color, IntoFont};

use super::{FONT, Plot, color};

const WIDTH: u32 = 900;
const LABELS: i32 = 250;
const FIGURES: i32 = 110;
const ROW: i32 = 30;
const TOP: i32 = 74;
/// Longer labels are cut.
const MOST_LETTERS: usize = 36;

/// One bar.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Its label, before it.
    pub label: String,
    /// One for each part.
    pub values: Vec<f64>,
}

/// Bars side by side, with one legend.
#[derive(Clone, Debug)]
pub struct BarPlot {
    /// The heading.
    pub title: String,
    /// The unit of the values.
    pub unit: String,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// From top to bottom.
    pub bars: Vec<Bar>,
}

impl Plot for BarPlot {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (TOP + ROW * self.bars.len() as i32 + 12) as u32)
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), Box<dyn Error>>
    where
        B::ErrorType: 'static,
    {
        let text =
            |text: String, place: (i32, i32), size: i32| Text::new(text, place, (FONT, size).into_font().color(&BLACK));
        area.draw(&text(format!("{}, {}", self.title, self.unit), (12, 10), 20))?;
        let mut x = 12;
        for (index, part) in self.parts.iter().enumerate() {
            area.draw(&Rectangle::new([(x, 44), (x + 12, 56)], color(index).filled()))?;
            area.draw(&text(part.clone(), (x + 17, 43), 13))?;
            x += 34 + 8 * part.chars().count() as i32;
        }
        let finite =
            |bar: &Bar| bar.values.iter().copied().filter(|value| value.is_finite() && *value > 0.0).sum::<f64>();
        let most = self.bars.iter().map(finite).fold(0.0, f64::max);
        let room = f64::from(WIDTH as i32 - LABELS - FIGURES);
        for (row, bar) in self.bars.iter().enumerate() {
            let y = TOP + ROW * row as i32;
            let mut label: String = bar.label.chars().take(MOST_LETTERS).collect();
            if label.len() < bar.label.len() {
                label.push_str("...");
            }
            area.draw(&text(label, (12, y + 4), 13))?;
            let mut sum = 0.0;
            for (index, value) in bar.values.iter().enumerate().filter(|(_, value)| value.is_finite() && **value > 0.0)
            {
                let place = |sum: f64| LABELS + (room * sum / most) as i32;
                area.draw(&Rectangle::new(
                    [(place(sum), y), (place(sum + value), y + ROW - 8)],
                    color(index).filled(),
                ))?;
                sum += value;
            }
            let end = if most > 0.0 { LABELS + (room * sum / most) as i32 } else { LABELS };
            let figure = if sum >= 100.0 { format!("{sum:.0}") } else { format!("{sum:.3}") };
            area.draw(&text(figure, (end + 6, y + 4), 13))?;
        }
        Ok(())
    }
}
