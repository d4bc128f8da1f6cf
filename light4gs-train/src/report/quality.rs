//! Quality by split and by view.

use std::fmt::Write as _;

use super::SplitQuality;
use super::chart::{Chart, Mark, Series};
use super::format::{count, fixed};
use super::html::escape;

pub(super) fn section(splits: &[SplitQuality]) -> String {
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

fn summary(html: &mut String, splits: &[SplitQuality]) {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in splits.iter().flat_map(|split| &split.extra) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    html.push_str("<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Split</th>");
    for name in ["Views", "PSNR, dB", "SSIM"].iter().chain(&names) {
        let _ = write!(html, "<th scope=\"col\" class=\"number\">{}</th>", escape(name));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for split in splits {
        let _ = write!(html, "<tr><th scope=\"row\">{}</th>", escape(&split.name));
        let mut cells = vec![count(split.views.len() as u64), fixed(split.psnr, 2), fixed(split.ssim, 4)];
        cells.extend(names.iter().map(|name| {
            let value = split.extra.iter().find(|(known, _)| known == name).map_or(f64::NAN, |(_, value)| *value);
            fixed(value, 4)
        }));
        for cell in cells {
            let _ = write!(html, "<td class=\"number\">{cell}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody>\n</table></div>\n");
}

fn views(html: &mut String, splits: &[SplitQuality]) {
    if splits.iter().all(|split| split.views.is_empty()) {
        return;
    }
    html.push_str(
        "<details><summary>View by view</summary>\n<div class=\"scroll tall\" tabindex=\"0\"><table>\n<thead><tr>\
         <th scope=\"col\">View</th><th scope=\"col\">Split</th><th scope=\"col\" class=\"number\">Time</th>\
         <th scope=\"col\" class=\"number\">PSNR, dB</th><th scope=\"col\" class=\"number\">SSIM</th></tr></thead>\n<tbody>\n",
    );
    for split in splits {
        for view in &split.views {
            let _ = writeln!(
                html,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
                 <td class=\"number\">{}</td></tr>",
                escape(&view.name),
                escape(&split.name),
                fixed(view.time.into(), 3),
                fixed(view.psnr, 2),
                fixed(view.ssim, 4)
            );
        }
    }
    html.push_str("</tbody>\n</table></div></details>\n");
}

fn over_time(splits: &[SplitQuality]) -> Chart {
    Chart {
        title: "PSNR over the time of the view, dB".to_owned(),
        x_label: "time".to_owned(),
        series: splits
            .iter()
            .map(|split| Series {
                label: split.name.clone(),
                mark: Mark::Dots,
                points: split.views.iter().map(|view| (f64::from(view.time), view.psnr)).collect(),
            })
            .collect(),
        logarithmic: false,
        from_zero: false,
        border: None,
    }
}
