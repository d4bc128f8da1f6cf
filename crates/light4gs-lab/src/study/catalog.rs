//! The studies of `configs/studies/`, which are embedded in the program.

macro_rules! studies {
    ($($name:literal),* $(,)?) => {
        /// Names of the built-in studies, in the paper's order, then our own.
        pub const NAMES: &[&str] = &[$($name),*];

        const TEXTS: &[&str] = &[$(include_str!(concat!("../../configs/studies/", $name, ".toml"))),*];
    };
}

studies![
    "d-nerf",
    "rate-distortion-curves",
    "composition",
    "context-model",
    "rate-distortion",
    "features",
    "spherical-harmonics",
    "adaptive-quantization",
    "bit-allocation",
    "latency",
    "pruning",
    "sizes",
    "motion",
    "attribute-rate",
    "minutes",
];

/// The text of a study.
pub(super) fn text(name: &str) -> Option<&'static str> {
    NAMES.iter().position(|known| *known == name).map(|index| TEXTS[index])
}

#[cfg(test)]
mod tests {
    use super::super::Study;
    use super::*;

    #[test]
    fn every_study_is_sound() {
        for name in NAMES {
            let study = Study::load(name).unwrap_or_else(|error| panic!("{error}"));
            assert!(!study.title.is_empty() && !study.reproduces.is_empty(), "{name}");
        }
    }

    #[test]
    fn every_file_is_embedded() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/studies");
        let mut files: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        files.sort();
        let mut names: Vec<_> = NAMES.iter().map(|name| (*name).to_owned()).collect();
        names.sort();
        assert_eq!(files, names);
    }
}
