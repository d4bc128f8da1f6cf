//! The files of `configs/`, embedded so that the binary alone is enough.

macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        /// Name and text of every preset, sorted by name.
        pub(super) const PRESETS: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../configs/", $name, ".toml")))),*];
    };
}

presets![
    "ablation-fixed-steps",
    "ablation-float32",
    "ablation-high-scale-hyperprior",
    "ablation-no-checkerboard",
    "ablation-no-context",
    "ablation-no-hyperprior",
    "ablation-no-inter-plane",
    "ablation-no-inter-scale",
    "ablation-no-pruning",
    "ablation-no-rate",
    "ablation-sh-autoregressive",
    "ablation-sh-hexplane",
    "ablation-sh-mixture",
    "base",
    "dnerf",
    "dnerf-bouncing",
    "dnerf-bouncing-small",
    "dnerf-dancer",
    "dnerf-dancer-small",
    "dnerf-flag",
    "dnerf-flag-small",
    "dnerf-lego",
    "dnerf-lego-small",
    "dnerf-small",
    "four-views",
    "high",
    "imported",
    "medium",
    "paper-profile",
    "quickstart",
    "small",
];

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
    PRESETS
        .iter()
        .map(|(known, _)| *known)
        .min_by_key(|known| strsim::damerau_levenshtein(known, name))
        .unwrap_or("base")
}
