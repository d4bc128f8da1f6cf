//! The files of `configs/`, embedded so that the binary alone is enough.

macro_rules! presets {
    ($($name:literal $(in $folder:literal)?),* $(,)?) => {
        /// Name and text of every preset, sorted by name.
        pub(super) const PRESETS: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../configs/", $($folder, "/",)? $name, ".toml")))),*];
    };
}

presets![
    "ablation-fixed-steps" in "ablations",
    "ablation-float32" in "ablations",
    "ablation-high-scale-hyperprior" in "ablations",
    "ablation-no-checkerboard" in "ablations",
    "ablation-no-context" in "ablations",
    "ablation-no-contraction" in "ablations",
    "ablation-no-hyperprior" in "ablations",
    "ablation-no-inter-plane" in "ablations",
    "ablation-no-inter-scale" in "ablations",
    "ablation-no-pca" in "ablations",
    "ablation-no-pruning" in "ablations",
    "ablation-no-rate" in "ablations",
    "ablation-sh-autoregressive" in "ablations",
    "ablation-sh-hexplane" in "ablations",
    "ablation-sh-mixture" in "ablations",
    "base",
    "colmap" in "captures",
    "colmap-small" in "captures",
    "dnerf",
    "dnerf-bouncing" in "dnerf-scenes",
    "dnerf-bouncing-small" in "dnerf-scenes",
    "dnerf-dancer" in "dnerf-scenes",
    "dnerf-dancer-small" in "dnerf-scenes",
    "dnerf-flag" in "dnerf-scenes",
    "dnerf-flag-small" in "dnerf-scenes",
    "dnerf-lego" in "dnerf-scenes",
    "dnerf-lego-small" in "dnerf-scenes",
    "dnerf-small",
    "four-views",
    "high",
    "hypernerf" in "captures",
    "hypernerf-small" in "captures",
    "imported",
    "medium",
    "nerfds" in "captures",
    "nerfds-small" in "captures",
    "nerfstudio" in "captures",
    "nerfstudio-small" in "captures",
    "neu3d" in "captures",
    "neu3d-small" in "captures",
    "paper-coding" in "papers",
    "paper-dnerf" in "papers",
    "paper-hypernerf" in "papers",
    "paper-nerfds" in "papers",
    "paper-neu3d" in "papers",
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
