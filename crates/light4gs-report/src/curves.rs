//! The run's curves over its iterations, both stages on one axis.

use light4gs_train::Stage;
use light4gs_train::observers::metrics_log::MetricsRecord;

use super::chart::{Chart, Mark, Series};

/// More points than this cannot be seen.
const MOST_POINTS: usize = 400;

pub(super) fn section(metrics: &[MetricsRecord]) -> String {
    if metrics.is_empty() {
        return String::new();
    }
    let coarse = metrics.iter().filter(|r| r.stage == Stage::Coarse).map(|r| r.iteration).max();
    let has_fine = metrics.iter().any(|r| r.stage == Stage::Fine);
    let offset = coarse.unwrap_or(0) as f64;
    let border = (coarse.is_some() && has_fine).then_some(offset);
    let points = |value: &dyn Fn(&MetricsRecord) -> Option<f64>| -> Vec<(f64, f64)> {
        let place = |r: &MetricsRecord| r.iteration as f64 + if r.stage == Stage::Fine { offset } else { 0.0 };
        metrics.iter().filter_map(|r| Some((place(r), value(r).filter(|v| v.is_finite())?))).collect()
    };
    let loss = points(&|r| r.loss);
    let psnr = points(&|r| r.psnr);
    let chart = |title: &str, series: Vec<Series>, logarithmic: bool, from_zero: bool| Chart {
        title: title.to_owned(),
        x_label: if border.is_some() { "iteration (shaded: coarse stage)" } else { "iteration" }.to_owned(),
        series,
        logarithmic,
        from_zero,
        border,
    };
    let series = |label: &str, mark: Mark, points: Vec<(f64, f64)>| Series { label: label.to_owned(), mark, points };
    let charts = [
        chart("Loss, logarithmic", noisy("loss", &loss), true, false),
        chart(
            "PSNR, dB",
            [noisy("training frames", &psnr), vec![series("test views", Mark::DottedLine, points(&|r| r.test_psnr))]]
                .concat(),
            false,
            false,
        ),
        chart(
            "Gaussians",
            vec![series("Gaussians", Mark::Line, thinned(&points(&|r| Some(r.gaussians as f64))))],
            false,
            true,
        ),
        chart(
            "Iterations per second",
            vec![series("it/s", Mark::Line, thinned(&points(&|r| r.iterations_per_second)))],
            false,
            true,
        ),
    ];
    let drawn: String = charts.iter().map(Chart::to_svg).collect();
    if drawn.is_empty() { drawn } else { format!("<div class=\"charts\">\n{drawn}</div>\n") }
}

/// A noisy value as a faint line behind its running mean.
fn noisy(label: &str, points: &[(f64, f64)]) -> Vec<Series> {
    let smooth = thinned(&running_mean(points, points.len() / 40));
    vec![
        Series { label: String::new(), mark: Mark::FaintLine, points: thinned(points) },
        Series { label: label.to_owned(), mark: Mark::Line, points: smooth },
    ]
}

/// Mean over a window of `reach` points to both sides. At the end, where the curve is flat, the window is cut off. At
/// the start, where the curve is steep, it shrinks on both sides, because one-sided it would shift the mean.
fn running_mean(points: &[(f64, f64)], reach: usize) -> Vec<(f64, f64)> {
    let mean = |index: usize| {
        let reach = reach.min(index);
        let window = &points[index - reach..(index + reach + 1).min(points.len())];
        window.iter().map(|(_, value)| value).sum::<f64>() / window.len() as f64
    };
    points.iter().enumerate().map(|(index, (x, _))| (*x, mean(index))).collect()
}

/// At most [`MOST_POINTS`] points, evenly chosen, the last among them.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(MOST_POINTS).max(1);
    let mut kept: Vec<_> = points.iter().rev().step_by(step).copied().collect();
    kept.reverse();
    kept
}
