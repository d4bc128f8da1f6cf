//! The files of `configs/`, embedded so that the binary alone is enough.

// `PRESETS: &[(&str, &str)]`, name and text of every preset, sorted by name. `build.rs` writes it from the files that
// there are.
include!(concat!(env!("OUT_DIR"), "/presets.rs"));

/// The names of the built-in presets, sorted.
pub fn preset_names() -> Vec<&'static str> {
    PRESETS.iter().map(|(name, _)| *name).collect()
}

/// The text of a preset.
pub(in crate::config) fn text(name: &str) -> Option<&'static str> {
    PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The preset whose name is most like `name`.
pub(in crate::config) fn nearest(name: &str) -> &'static str {
    light4gs_keys::nearest(PRESETS.iter().map(|(known, _)| *known), name).unwrap_or("base")
}

/// The preset that fits datasets of a layout: the one of its name.
pub(in crate::config) fn of_layout(layout: &str) -> Option<&'static str> {
    PRESETS.iter().map(|(name, _)| *name).find(|name| *name == layout)
}
