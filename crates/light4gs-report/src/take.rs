//! A page about a take: quality and flicker over its seconds, with its joins.

use light4gs_train::take::{JoinScores, TakeEvaluation, TakeFrame};

use super::chart::{Chart, Mark, Series};
use super::page_of;

/// The page.
pub fn take_page(title: &str, evaluation: &TakeEvaluation) -> String {
    let about = format!(
        "{} bytes, {} segments, {:.2} kB per frame, base {} bytes",
        evaluation.bytes, evaluation.segments, evaluation.kilobytes_a_frame, evaluation.base_bytes
    );
    let charts = [
        chart(
            "PSNR of test views, dB",
            evaluation,
            &|frame| (frame.split == "test").then_some(frame.psnr),
            &TakeFrame::is_at_join,
        ),
        chart(
            "SSIM of test views",
            evaluation,
            &|frame| (frame.split == "test").then_some(frame.ssim),
            &TakeFrame::is_at_join,
        ),
        chart("Flicker, shares of white", evaluation, &|frame| frame.flicker, &|frame| frame.crosses_join),
    ];
    let sections =
        [("Joins", table(evaluation)), ("By second", format!("<div class=\"charts\">\n{}</div>\n", charts.concat()))];
    page_of(title, &about, &sections.map(|(heading, html)| (heading.to_owned(), html)))
}

fn chart(
    title: &str,
    evaluation: &TakeEvaluation,
    value: &dyn Fn(&TakeFrame) -> Option<f64>,
    at_join: &dyn Fn(&TakeFrame) -> bool,
) -> String {
    let points = |wanted: bool| {
        let frames = evaluation.frames.iter().filter(|frame| at_join(frame) == wanted);
        frames.filter_map(|frame| Some((frame.seconds, value(frame)?))).collect()
    };
    let series = |label: &str, points| Series { label: label.to_owned(), mark: Mark::Dots, points };
    let chart = Chart {
        title: title.to_owned(),
        x_label: "seconds".to_owned(),
        series: vec![series("elsewhere", points(false)), series("at joins", points(true))],
        logarithmic: false,
        from_zero: false,
        border: None,
    };
    chart.to_svg()
}

fn table(evaluation: &TakeEvaluation) -> String {
    let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    let row = |name: &str, scores: &JoinScores, digits: usize| {
        let [all, at_joins, elsewhere] =
            [scores.all, scores.at_joins, scores.elsewhere].map(|value| number(value, digits));
        format!("<tr><th scope=\"row\">{name}</th><td>{all}</td><td>{at_joins}</td><td>{elsewhere}</td></tr>\n")
    };
    let rows = [
        row("PSNR, dB", &evaluation.psnr, 2),
        row("SSIM", &evaluation.ssim, 4),
        row("flicker", &evaluation.flicker, 5),
    ];
    format!("<table>\n<tr><th></th><th>all</th><th>at joins</th><th>elsewhere</th></tr>\n{}</table>\n", rows.concat())
}
