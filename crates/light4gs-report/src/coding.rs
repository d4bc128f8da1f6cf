//! The coding of planes, spherical harmonics and attributes: expected and actual bits, every plane, and maps of the bits
//! (the paper's figure "bitrate allocation").

use std::fmt::Write as _;
use std::path::Path;

use light4gs_data::{DataError, RgbImage8};
use light4gs_train::compression::{BitMap, CodedPart, CodingRecord};

use super::CodingReport;
use super::color_map::{css_gradient, inferno};
use super::format::{count, fixed};
use super::html::escape;
use super::images::data_uri;

pub(super) fn section(path: &Path, coding: Option<&CodingReport>) -> Result<String, DataError> {
    let Some(CodingReport { record, bit_maps }) = coding else { return Ok(String::new()) };
    if !record.parts().iter().any(CodedPart::is_modeled) {
        return Ok(String::new());
    }
    let mut html = String::new();
    bits_table(&mut html, "Part", record.parts().into_iter().filter(CodedPart::is_modeled), sentence_case);
    if !record.attributes.is_empty() {
        html.push_str("<details><summary>Attribute by attribute</summary>\n");
        bits_table(&mut html, "Attribute", record.attribute_parts(), |name| format!("<code>{}</code>", escape(name)));
        html.push_str("</details>\n");
    }
    if !record.planes.is_empty() {
        plane_table(&mut html, record);
    }
    maps(&mut html, path, bit_maps)?;
    Ok(html)
}

/// Expected bits beside those in the file.
fn bits_table(html: &mut String, what: &str, parts: impl Iterator<Item = CodedPart>, name: impl Fn(&str) -> String) {
    let _ = write!(
        html,
        "<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">{what}</th><th scope=\"col\" class=\"number\">Bits expected</th>\
         <th scope=\"col\" class=\"number\">Bits in the file</th><th scope=\"col\" class=\"number\">Difference</th></tr></thead>\n<tbody>\n",
    );
    for part in parts {
        let _ = writeln!(
            html,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number\">{}</td></tr>",
            name(&part.name),
            count(part.expected.round() as u64),
            count(part.coded as u64),
            part.difference().replace(' ', "&nbsp;")
        );
    }
    html.push_str("</tbody>\n</table></div>\n");
}

fn plane_table(html: &mut String, record: &CodingRecord) {
    html.push_str(
        "<details><summary>Plane by plane</summary>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th scope=\"col\">Plane</th><th scope=\"col\" class=\"number\">Step</th><th scope=\"col\" class=\"number\">Values</th>\
         <th scope=\"col\" class=\"number\">Bytes of values</th><th scope=\"col\" class=\"number\">Bytes of hyperprior</th>\
         <th scope=\"col\" class=\"number\">Bits a value</th></tr></thead>\n<tbody>\n",
    );
    for plane in &record.planes {
        let bits = 8.0 * (plane.value_bytes + plane.latent_bytes) as f64 / plane.symbols.max(1) as f64;
        let _ = writeln!(
            html,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number\">{}</td><td class=\"number\">{}</td></tr>",
            escape(&plane.name),
            fixed(plane.step.into(), 5),
            count(plane.symbols as u64),
            count(plane.value_bytes),
            count(plane.latent_bytes),
            fixed(bits, 3)
        );
    }
    html.push_str("</tbody>\n</table></div></details>\n");
}

/// The text with a capital at its beginning.
fn sentence_case(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// One scale of colors for all planes, so that they can be compared.
fn maps(html: &mut String, path: &Path, bit_maps: &[BitMap]) -> Result<(), DataError> {
    let most = bit_maps.iter().flat_map(|map| &map.bits).fold(0.0f32, |most, bits| most.max(*bits));
    if most <= 0.0 {
        return Ok(());
    }
    let _ = writeln!(
        html,
        "<p class=\"legend\">Bits at each place of a plane, all channels together, \
         <span class=\"scale\">0 <i style=\"background:{}\"></i> {}</span></p>\n<div class=\"maps\">",
        css_gradient(),
        fixed(most.into(), 1)
    );
    for map in bit_maps {
        let pixels = map.bits.iter().flat_map(|bits| inferno(bits / most)).collect();
        let image = RgbImage8 { width: map.width, height: map.height, pixels };
        let data = data_uri(&image).map_err(|error| DataError::Image {
            path: path.to_path_buf(),
            problem: format!("bit map of plane {}: {error}", map.name),
            remedy: "this is a fault of the program: please report it".to_owned(),
        })?;
        let name = escape(&map.name);
        let _ = writeln!(html, "<div><img src=\"{data}\" alt=\"Bits of plane {name}\"><span>{name}</span></div>");
    }
    html.push_str("</div>\n");
    Ok(())
}
