//! Quality by split and by view.

use std::fmt::Write as _;

use light4gs_data::Region;
use light4gs_train::evaluation::SplitScore;
use light4gs_train::metrics::Metric;
use light4gs_train::metrics::scores::Scores;

use super::chart::{Chart, Mark, Series};
use super::format::{count, fixed};
use super::html::escape;

pub(super) fn section(splits: &[SplitScore]) -> String {
    if splits.is_empty() {
        return String::new();
    }
    let mut html = String::from("<div class=\"columns\">\n<div>\n");
    summary(&mut html, splits);
    views(&mut html, splits);
    html.push_str("</div>\n");
    html.push_str(&over_time(splits).to_svg());
    html.push_str("</div>\n");
    html
}

/// The meaning of the columns, for readers who compare with other tables.
fn legend(columns: &[Metric]) -> String {
    const ALWAYS: &str = "SSIM has zeros around the image, as 3DGS; SSIM valid counts windows inside it, as TensorFlow and \
        scikit-image with Gaussian weights. D-SSIM is (1 - MS-SSIM) / 2. LPIPS needs weights from a file: <code>light4gs eval \
        --lpips FILE</code>. The worst 5 % are the pixels of a view with the largest squared errors.";
    const MOTION: &str = " Moving and still pixels are told apart by the dataset's masks; figures of a split are over all such \
        pixels of its views together.";
    const MASKED: &str = " Metrics with an m leave out the pixels that the dataset's masks ignore.";
    let has =
        |wanted: Region| columns.iter().any(|metric| matches!(metric, Metric::Of(region, _) if *region == wanted));
    let motion = if has(Region::Moving) || has(Region::Still) { MOTION } else { "" };
    let masked = if has(Region::Masked) { MASKED } else { "" };
    format!("<p class=\"legend\">{ALWAYS}{motion}{masked}</p>\n")
}

/// The meaning of the rows of fitted views.
const FITTED: &str = "<p class=\"legend\">This run has learned an exposure, a pose or a time for each training view or camera. A \
    view that was not trained on has none, so the plain figures also count how far the dataset is off there. For the rows of \
    fitted views the same few numbers were fitted to each view, with the scene as it is.</p>\n";

fn heads(html: &mut String, names: &[&str], columns: &[Metric]) {
    html.push_str("<thead><tr>");
    for name in names {
        let _ = write!(html, "<th scope=\"col\">{name}</th>");
    }
    for column in columns {
        let _ = write!(html, "<th scope=\"col\" class=\"number\">{}</th>", column.label());
    }
    html.push_str("</tr></thead>\n<tbody>\n");
}

fn cells(html: &mut String, scores: &Scores, columns: &[Metric]) {
    for column in columns {
        let _ = write!(html, "<td class=\"number\">{}</td>", column.format(scores.get(*column)));
    }
    html.push_str("</tr>\n");
}

fn summary(html: &mut String, splits: &[SplitScore]) {
    let columns = Scores::columns(splits.iter().map(|split| &split.scores));
    html.push_str("<div class=\"scroll\"><table>\n");
    heads(html, &["Split", "Views"], &columns);
    for split in splits {
        let (name, views) = (escape(&split.split), count(split.views.len() as u64));
        let fitted = split.fitted.as_ref().map(|scores| (format!("{name}, each view fitted"), scores));
        for (name, scores) in [(name, &split.scores)].into_iter().chain(fitted) {
            let _ = write!(html, "<tr><th scope=\"row\">{name}</th><td class=\"number\">{views}</td>");
            cells(html, scores, &columns);
        }
    }
    html.push_str("</tbody>\n</table></div>\n");
    html.push_str(&legend(&columns));
    if splits.iter().any(|split| split.fitted.is_some()) {
        html.push_str(FITTED);
    }
}

fn views(html: &mut String, splits: &[SplitScore]) {
    if splits.iter().all(|split| split.views.is_empty()) {
        return;
    }
    let columns = Scores::columns(splits.iter().map(|split| &split.scores));
    html.push_str("<details><summary>View by view</summary>\n<div class=\"scroll tall\" tabindex=\"0\"><table>\n");
    heads(html, &["View", "Split", "Time"], &columns);
    for split in splits {
        for view in &split.views {
            let _ = write!(
                html,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"number\">{}</td>",
                escape(&view.name),
                escape(&split.split),
                fixed(view.time.into(), 3),
            );
            cells(html, &view.scores, &columns);
            if let Some(fitted) = &view.fitted {
                let _ = write!(html, "<tr><th scope=\"row\">{}, fitted</th><td></td><td></td>", escape(&view.name));
                cells(html, &fitted.scores, &columns);
            }
        }
    }
    html.push_str("</tbody>\n</table></div></details>\n");
}

fn over_time(splits: &[SplitScore]) -> Chart {
    Chart {
        title: "PSNR over the time of the view, dB".to_owned(),
        x_label: "time".to_owned(),
        series: splits
            .iter()
            .map(|split| Series {
                label: split.split.clone(),
                mark: Mark::Dots,
                points: split.views.iter().map(|view| (f64::from(view.time), view.scores.psnr())).collect(),
            })
            .collect(),
        logarithmic: false,
        from_zero: false,
        border: None,
    }
}
