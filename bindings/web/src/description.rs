//! The contents of a file, or the error in it, as JSON for the page.

use std::fmt::{Display, Write as _};

use light4gs_codec::{CodecError, SceneData, SceneMeta, SectionInfo, VERSION};

/// Facts about a file, besides its scene.
#[derive(Debug)]
pub(crate) struct Facts<'a> {
    /// Of the whole file.
    pub(crate) bytes: u64,
    /// Number of layers of Gaussians, and of those that have come.
    pub(crate) layers: usize,
    pub(crate) shown: usize,
    pub(crate) sections: &'a [SectionInfo],
}

/// The description of a scene with `levels` levels of detail: `{"name": ..., "sections": [...]}`.
pub(crate) fn describe(scene: &SceneData, facts: &Facts<'_>, levels: u32) -> String {
    let SceneMeta { name, frame_count, fps, bounds, background, width, height, fov_x, extra, .. } = &scene.meta;
    let sizes = SectionInfo::bytes_by_name(facts.sections);
    let sections = sizes.iter().map(|(name, bytes)| format!("[{},{bytes}]", text(name)));
    let extra = extra.iter().map(|(key, value)| format!("{}:{}", text(key), text(value)));
    format!(
        "{{\"name\":{},\"frameCount\":{frame_count},\"fps\":{fps},\"bounds\":[{},{}],\"background\":{},\"width\":{width},\
         \"height\":{height},\"fovX\":{fov_x},\"version\":{VERSION},\"bytes\":{},\"count\":{},\"shDegree\":{},\"moves\":{},\
         \"layers\":{},\"layersShown\":{},\"levels\":{levels},\"sections\":{},\"extra\":{{{}}}}}",
        text(name),
        list(bounds[0]),
        list(bounds[1]),
        list(*background),
        facts.bytes,
        scene.gaussians.len(),
        scene.gaussians.sh_degree,
        scene.motion.network.is_some(),
        facts.layers,
        facts.shown,
        list(sections),
        extra.collect::<Vec<_>>().join(","),
    )
}

/// An error: `{"error": kind, "message": ...}`, where the kind is for the page to choose its words by.
pub(crate) fn describe_error(error: &CodecError) -> String {
    let kind = match error {
        CodecError::NotL4gs { .. } => "not-l4gs",
        CodecError::NewerVersion { .. }
        | CodecError::UnknownKind { .. }
        | CodecError::UnknownEncoding { .. }
        // A take within a take.
        | CodecError::IsTake => "newer",
        CodecError::OverLimit { .. } => "too-large",
        _ => "damaged",
    };
    format!("{{\"error\":{},\"message\":{}}}", text(kind), text(&error.to_string()))
}

pub(crate) fn list(items: impl IntoIterator<Item = impl Display>) -> String {
    let items: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    format!("[{}]", items.join(","))
}

/// A JSON string.
pub(crate) fn text(value: &str) -> String {
    let mut quoted = String::from('"');
    for character in value.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control < ' ' => {
                let _ = write!(quoted, "\\u{:04x}", u32::from(control));
            }
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_are_escaped() {
        assert_eq!(text("a\"b\\c\n<ü>"), r#""a\"b\\c\u000a<ü>""#);
    }

    #[test]
    fn errors_have_a_kind() {
        let newer = describe_error(&CodecError::NewerVersion { found: 9 });
        assert!(newer.starts_with(r#"{"error":"newer","message":"the stream has version 9"#), "{newer}");
    }
}
