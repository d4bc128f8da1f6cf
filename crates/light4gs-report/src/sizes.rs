//! The sizes of the sections of the file.

use std::fmt::Write as _;

use light4gs_train::evaluation::SectionSize;

use super::format::{count, fixed};
use super::html::escape;

pub(super) fn section(sections: &[SectionSize]) -> String {
    if sections.is_empty() {
        return String::new();
    }
    let total: u64 = sections.iter().fold(0, |sum, section| sum.saturating_add(section.bytes));
    let share = |bytes: u64| {
        if total == 0 { 0.0 } else { bytes as f64 / total as f64 * 100.0 }
    };
    let mut html = String::from(
        "<div class=\"scroll\"><table class=\"sizes\">\n<thead><tr><th scope=\"col\">Section</th>\
         <th scope=\"col\" class=\"number\">Bytes</th><th scope=\"col\" class=\"number\">Share</th>\
         <th aria-hidden=\"true\"></th></tr></thead>\n<tbody>\n",
    );
    for section in sections {
        let percent = fixed(share(section.bytes), 1);
        let _ = writeln!(
            html,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td><td class=\"number\">{percent}&nbsp;%</td>\
             <td class=\"bar\" aria-hidden=\"true\"><i style=\"width:{percent}%\"></i></td></tr>",
            escape(&section.name),
            count(section.bytes)
        );
    }
    let _ = writeln!(
        html,
        "</tbody>\n<tfoot><tr><th scope=\"row\">Together</th><td class=\"number\">{}</td><td class=\"number\"></td>\
         <td class=\"bar\"></td></tr></tfoot>\n</table></div>",
        count(total)
    );
    html
}
