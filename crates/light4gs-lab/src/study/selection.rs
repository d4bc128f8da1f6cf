//! Some of a study's runs, by the parts of their names: a scene, a value of an axis, `seed-0`.

use light4gs_keys::nearest;
use light4gs_train::error::TrainError;

use super::Manifest;
use super::definition::Study;

/// Some of a study's runs. Without any part, all of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// For the scene, each axis and the seed: the names of which a run must have one. Any name will do where there are none.
    parts: Vec<Vec<String>>,
}

impl Selection {
    /// The runs whose names have these parts. A run must have one of the scenes that are named, one of the values that are
    /// named of each axis, and one of the seeds that are named.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a name that no run has.
    pub fn new(only: &[String], study: &Study, scenes: &[String], seeds: u64) -> Result<Self, TrainError> {
        let mut known = vec![scenes.to_vec()];
        known.extend(study.axis.iter().map(|axis| axis.value.iter().map(|value| value.name.clone()).collect()));
        known.push((0..seeds).map(|seed| format!("seed-{seed}")).collect());
        if let Some(part) = only.iter().find(|part| !known.iter().any(|names| names.contains(part))) {
            let all = || known.iter().flatten().map(String::as_str);
            let nearest = nearest(all(), part).unwrap_or_default();
            let names = all().collect::<Vec<_>>().join(", ");
            return Err(TrainError::Input(format!(
                "--only: no run's name has the part \"{part}\"; the nearest is \"{nearest}\". Parts are {names}"
            )));
        }
        let chosen = |names: Vec<String>| names.into_iter().filter(|name| only.contains(name)).collect();
        Ok(Self { parts: known.into_iter().map(chosen).collect() })
    }

    /// All runs of a study.
    pub fn all(manifest: &Manifest) -> Self {
        Self { parts: vec![Vec::new(); manifest.study.axis.len() + 2] }
    }

    /// Whether the run of this name, `SCENE/VALUE+VALUE/seed-K`, is among them.
    pub fn has(&self, run: &str) -> bool {
        let Some((scene, rest)) = run.split_once('/') else { return false };
        let Some((variant, seed)) = rest.rsplit_once('/') else { return false };
        let names = std::iter::once(scene).chain(variant.split('+')).chain([seed]);
        names.zip(&self.parts).all(|(name, chosen)| chosen.is_empty() || chosen.iter().any(|part| part == name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn selection(only: &[&str]) -> Result<Selection, TrainError> {
        let text = r#"
title = "t"
reproduces = "nothing"
outputs = ["table"]
[[axis]]
name = "size"
value = [{ name = "small" }, { name = "high" }]
[[axis]]
name = "pixels"
value = [{ name = "400" }, { name = "800" }]
"#;
        let only: Vec<String> = only.iter().map(ToString::to_string).collect();
        Selection::new(&only, &Study::from_toml(text, "test")?, &["balls".into(), "flag".into()], 2)
    }

    #[test]
    fn parts_of_one_kind_add_up_and_of_several_restrict() {
        let runs = ["balls/small+400/seed-0", "balls/high+400/seed-1", "flag/high+800/seed-0", "flag/small+800/seed-1"];
        let chosen = |only: &[&str]| {
            let selection = selection(only).unwrap();
            runs.iter().filter(|run| selection.has(run)).copied().collect::<Vec<_>>()
        };
        assert_eq!(chosen(&[]), runs);
        assert_eq!(chosen(&["400"]), runs[..2]);
        assert_eq!(chosen(&["small", "high", "flag"]), runs[2..]);
        assert_eq!(chosen(&["high", "seed-0"]), runs[2..3]);
        assert!(chosen(&["balls", "800"]).is_empty());
    }

    #[test]
    fn a_name_that_no_run_has_is_refused() {
        let error = selection(&["400", "h1gh"]).unwrap_err().to_string();
        assert!(error.contains("--only") && error.contains("h1gh") && error.contains("high"), "{error}");
        assert!(selection(&["seed-2"]).is_err());
    }
}
