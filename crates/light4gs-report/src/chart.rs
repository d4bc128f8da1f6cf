//! Line and point charts in SVG. Colors are the style sheet's.

use std::fmt::Write as _;

use super::format::short;
use super::html::escape;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 260.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 38.0;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    Line,
    /// Background of the next series, in that series' color.
    FaintLine,
    DottedLine,
    Dots,
}

/// Some points, in order of x if they make a line.
#[derive(Debug, Clone)]
pub(super) struct Series {
    pub(super) label: String,
    pub(super) mark: Mark,
    pub(super) points: Vec<(f64, f64)>,
}

#[derive(Debug, Clone)]
pub(super) struct Chart {
    pub(super) title: String,
    pub(super) x_label: String,
    pub(super) series: Vec<Series>,
    /// A logarithmic axis. If a value is not above zero, the axis is linear all the same.
    pub(super) logarithmic: bool,
    pub(super) from_zero: bool,
    /// The part up to here is shaded: the coarse stage.
    pub(super) border: Option<f64>,
}

impl Chart {
    /// The chart as a figure; nothing if there is no point.
    pub(super) fn to_svg(&self) -> String {
        let mut series = self.series.clone();
        for one in &mut series {
            one.points.retain(|(x, y)| x.is_finite() && y.is_finite());
        }
        series.retain(|one| !one.points.is_empty());
        let Some(axes) = Axes::around(self, &series) else {
            return String::new();
        };
        let mut svg = String::new();
        axes.draw(&mut svg, self);
        let mut color = 0;
        let mut legend = String::new();
        for one in &series {
            axes.draw_series(&mut svg, one, color % 3);
            if one.mark != Mark::FaintLine {
                if let Some((_, last)) = one.points.last() {
                    let line = matches!(one.mark, Mark::Line | Mark::DottedLine);
                    let last = if line { format!(" <b>{}</b>", short(*last)) } else { String::new() };
                    let _ = write!(legend, "<span class=\"key s{}\">{}{last}</span>", color % 3, escape(&one.label));
                }
                color += 1;
            }
        }
        let title = escape(&self.title);
        format!(
            "<figure class=\"chart\">\n<figcaption><b>{title}</b>{legend}</figcaption>\n\
             <svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">\n{svg}</svg>\n</figure>\n",
            escape(&self.spoken(&series))
        )
    }

    /// The chart described in words.
    fn spoken(&self, series: &[Series]) -> String {
        let mut text = format!("{} over {}.", self.title, self.x_label);
        for one in series.iter().filter(|one| one.mark != Mark::FaintLine) {
            let values = || one.points.iter().map(|(_, y)| *y);
            let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            let last = values().next_back().unwrap_or(f64::NAN);
            let _ = write!(text, " {}: {} to {}, last {}.", one.label, short(least), short(most), short(last));
        }
        text
    }
}

/// The mapping from values to positions.
struct Axes {
    x: (f64, f64),
    y: (f64, f64),
    logarithmic: bool,
    y_ticks: Vec<f64>,
}

impl Axes {
    fn around(chart: &Chart, series: &[Series]) -> Option<Self> {
        let all = || series.iter().flat_map(|one| &one.points);
        all().next()?;
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
        };
        let mut x = range(&mut all().map(|(x, _)| *x));
        if chart.border.is_some() {
            x.0 = x.0.min(0.0);
        }
        if x.0 == x.1 {
            x = (x.0 - 0.5, x.1 + 0.5);
        }
        let y = range(&mut all().map(|(_, y)| *y));
        if chart.logarithmic && y.0 > 0.0 {
            let y = if y.0 == y.1 { (y.0 / 2.0, y.1 * 2.0) } else { y };
            return Some(Self { x, y, logarithmic: true, y_ticks: log_ticks(y.0, y.1) });
        }
        let low = if chart.from_zero { y.0.min(0.0) } else { y.0 };
        let (low, high) = if low == y.1 { (low - 0.5, y.1 + 0.5) } else { (low, y.1) };
        let step = nice_step(low, high, 5);
        // The axis ends on ticks.
        let y = ((low / step).floor() * step, (high / step).ceil() * step);
        Some(Self { x, y, logarithmic: false, y_ticks: ticks(y.0, y.1, step) })
    }

    fn place_x(&self, x: f64) -> f64 {
        LEFT + (x - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - LEFT - RIGHT)
    }

    fn place_y(&self, y: f64) -> f64 {
        let share = if self.logarithmic {
            (y / self.y.0).ln() / (self.y.1 / self.y.0).ln()
        } else {
            (y - self.y.0) / (self.y.1 - self.y.0)
        };
        HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)
    }

    fn draw(&self, svg: &mut String, chart: &Chart) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        if let Some(border) = chart.border {
            let border = self.place_x(border);
            let _ = writeln!(
                svg,
                "<rect class=\"stage\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                (border - LEFT).max(0.0),
                bottom - TOP
            );
        }
        for tick in &self.y_ticks {
            let y = self.place_y(*tick);
            let _ = writeln!(
                svg,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 6.0,
                y + 4.0,
                short(*tick)
            );
        }
        for tick in ticks(self.x.0, self.x.1, nice_step(self.x.0, self.x.1, 6)) {
            let x = self.place_x(tick);
            let _ = writeln!(
                svg,
                "<line class=\"tick\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{bottom}\" y2=\"{:.1}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 4.0,
                bottom + 16.0,
                short(tick)
            );
        }
        let _ = writeln!(
            svg,
            "<line class=\"axis\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{bottom}\" y2=\"{bottom}\"/>\
             <text x=\"{right}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            HEIGHT - 6.0,
            escape(&chart.x_label)
        );
    }

    fn draw_series(&self, svg: &mut String, series: &Series, color: usize) {
        let places = || series.points.iter().map(|(x, y)| (self.place_x(*x), self.place_y(*y)));
        let line = series.mark != Mark::Dots && series.points.len() > 1;
        if line {
            let path: Vec<String> = places().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let faint = if series.mark == Mark::FaintLine { " faint" } else { "" };
            let _ = writeln!(svg, "<polyline class=\"s{color}{faint}\" points=\"{}\"/>", path.join(" "));
        }
        if !line || series.mark == Mark::DottedLine {
            for ((cx, cy), (x, y)) in places().zip(&series.points) {
                let _ = writeln!(
                    svg,
                    "<circle class=\"s{color}\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"3.2\"><title>{}: {}</title></circle>",
                    short(*x),
                    short(*y)
                );
            }
        }
    }
}

/// The smallest of 1, 2, 5 times a power of ten that makes at most `count` steps.
fn nice_step(low: f64, high: f64, count: usize) -> f64 {
    let least = ((high - low) / count as f64).max(f64::MIN_POSITIVE);
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|factor| factor * power).find(|step| *step >= least).unwrap_or(10.0 * power)
}

/// Multiples of `step` in the range.
fn ticks(low: f64, high: f64, step: f64) -> Vec<f64> {
    let slack = step * 1e-6;
    // Values that differ only by rounding must not give an endless number of ticks.
    (0..20)
        .map(|index| ((low / step).ceil() + f64::from(index)) * step)
        .take_while(|tick| *tick <= high + slack)
        .collect()
}

/// 1, 2 and 5 times powers of ten in the range; only the powers if those would be too many.
fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let powers = (low.log10().floor() as i32)..=(high.log10().ceil() as i32);
    let candidates = |factors: &'static [f64]| -> Vec<f64> {
        let all = powers.clone().flat_map(|power| factors.iter().map(move |factor| factor * 10_f64.powi(power)));
        all.filter(|tick| (low * 0.999..=high * 1.001).contains(tick)).collect()
    };
    let fine = candidates(&[1.0, 2.0, 5.0]);
    match fine.len() {
        0..=1 => vec![low, high],
        2..=7 => fine,
        _ => candidates(&[1.0]),
    }
}
