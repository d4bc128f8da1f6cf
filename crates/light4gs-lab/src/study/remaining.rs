//! The time that the missing runs of a study will take, from what its runs took so far.

use std::collections::BTreeSet;

use super::manifest::Manifest;
use super::results::Results;

/// A run that has done less of its iterations says little about the rest: iterations become slower with more Gaussians.
const LEAST_SHARE: f64 = 0.05;

/// The trainings that are missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Remaining {
    /// Number of trainings.
    pub trainings: usize,
    /// Seconds of those whose time can be estimated, one after another.
    pub seconds: f64,
    /// Number of trainings whose time cannot be estimated: no run of the variant is finished, and their own has hardly begun.
    pub unknown: usize,
}

impl Remaining {
    /// Estimates what is missing. A training takes as long as the mean of the finished ones of its variant, or else goes on
    /// at its own pace.
    pub fn of(manifest: &Manifest, results: &Results) -> Self {
        let missing: BTreeSet<&str> = results.missing.iter().map(|run| run.run.as_str()).collect();
        let mut remaining = Self::default();
        let mut tasks = BTreeSet::new();
        // The first run of a task is the one that is trained.
        for run in manifest.runs.iter().filter(|run| tasks.insert(run.task)) {
            let trained = manifest.task(run.task).any(|run| !missing.contains(run.name.as_str()));
            let Some(own) = results.missing.iter().find(|missing| missing.run == run.name) else { continue };
            if trained {
                continue;
            }
            remaining.trainings += 1;
            let like = results.runs.iter().filter(|finished| finished.variant == run.variant);
            let times: Vec<f64> = like.filter_map(|finished| finished.training_seconds).collect();
            let whole = match times.len() {
                0 => (own.share >= LEAST_SHARE).then(|| own.seconds / own.share),
                count => Some(times.iter().sum::<f64>() / count as f64),
            };
            match whole {
                Some(seconds) => remaining.seconds += seconds * (1.0 - own.share),
                None => remaining.unknown += 1,
            }
        }
        remaining
    }
}

impl std::fmt::Display for Remaining {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { trainings, seconds, unknown } = self;
        write!(formatter, "{trainings} trainings to do")?;
        if unknown < trainings {
            let known = trainings - unknown;
            write!(formatter, ", {known} of them in about {:.1} hours, one after another", seconds / 3600.0)?;
        }
        if *unknown > 0 {
            write!(formatter, "; for {unknown} there is no run to estimate the time from")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::tests::example;
    use super::*;

    #[test]
    fn a_run_takes_as_long_as_its_like_or_goes_on_at_its_pace() {
        let (manifest, mut results) =
            example(&["x", "y"], 1, |scene, variant, _| ((scene, variant) == (0, 0)).then_some(20.0));
        results.runs[0].training_seconds = Some(3600.0);
        assert_eq!(Remaining::of(&manifest, &results), Remaining { trainings: 3, seconds: 3600.0, unknown: 2 });
        let own = results.missing.iter_mut().find(|missing| missing.run == "x/two/seed-0").unwrap();
        (own.share, own.seconds) = (0.25, 900.0);
        let remaining = Remaining::of(&manifest, &results);
        assert_eq!(remaining, Remaining { trainings: 3, seconds: 3600.0 + 2700.0, unknown: 1 });
        let text = remaining.to_string();
        assert!(text.contains("2 of them in about 1.8 hours") && text.contains("for 1 there is no run"), "{text}");
    }
}
