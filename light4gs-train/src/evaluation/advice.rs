//! What the figures of a run say about its capture and its schedule, and what to do. Each rule has a threshold; a good run
//! gets no advice.

use crate::config::Config;
use crate::observers::metrics_log::MetricsRecord;
use crate::stage::Stage;

/// Test views above this PSNR, dB, are good, whatever else the figures say.
const GOOD: f64 = 32.0;
/// A schedule is short where the last fifth of it still adds as many decibels.
const STILL_RISING: f64 = 0.5;
/// Training views that are better than test views by as many decibels fit what test views do not confirm.
const NOT_CONFIRMED: f64 = 6.0;
/// The share of `max_gaussians` that counts as all of them.
const FULL: f64 = 0.98;
/// The share of densification that must be spent at the limit.
const LONG_FULL: f64 = 0.3;

/// Advice for a run that comes out badly, from the PSNR of its test views (dB), the records of its training and the faults of
/// its capture; empty for a good one.
pub(super) fn advice(config: &Config, test: f64, records: &[MetricsRecord], faults: Vec<String>) -> Vec<String> {
    if test.is_nan() || test >= GOOD {
        return Vec::new();
    }
    let fine: Vec<&MetricsRecord> = records.iter().filter(|record| record.stage == Stage::Fine).collect();
    let rules = [still_rising(&fine), too_few_gaussians(config, &fine), not_confirmed(&fine, test)];
    faults.into_iter().chain(rules.into_iter().flatten()).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// A figure of a record, if it was measured.
type Figure = fn(&MetricsRecord) -> Option<f64>;

/// The mean of some figure from one share of the iterations to another.
fn within(fine: &[&MetricsRecord], from: f64, to: f64, figure: Figure) -> Option<f64> {
    let last = fine.last()?.iteration as f64;
    let within = |record: &&&MetricsRecord| (from * last..=to * last).contains(&(record.iteration as f64));
    mean(fine.iter().filter(within).filter_map(|record| figure(record)))
}

/// By test views, or by training views where test views were not measured on the way.
fn still_rising(fine: &[&MetricsRecord]) -> Option<String> {
    let figures: [(Figure, &str); 2] = [(|record| record.test_psnr, "test"), (|record| record.psnr, "training")];
    let rise = |figure| Some(within(fine, 0.9, 1.0, figure)? - within(fine, 0.6, 0.8, figure)?);
    let (rise, views) = figures.into_iter().find_map(|(figure, views)| Some((rise(figure)?, views)))?;
    (rise > STILL_RISING).then(|| {
        format!(
            "the schedule is short: the last fifth of the iterations still added {rise:.1} dB on the {views} views; train \
             longer, for example with --minutes"
        )
    })
}

fn too_few_gaussians(config: &Config, fine: &[&MetricsRecord]) -> Option<String> {
    let most = config.train.densify.chosen().max_gaussians()?;
    let growing = fine.iter().filter(|record| record.iteration <= config.train.densify.chosen().end());
    let (full, all) = growing.fold((0, 0), |(full, all), record| {
        (full + usize::from(record.gaussians as f64 >= FULL * most as f64), all + 1)
    });
    (all > 0 && full as f64 > LONG_FULL * all as f64).then(|| {
        format!(
            "there are too few Gaussians for these images: the limit of {most} was reached early; allow more bytes, with \
             --target-bytes or --set train.densify.adaptive.max_gaussians"
        )
    })
}

fn not_confirmed(fine: &[&MetricsRecord], test: f64) -> Option<String> {
    let last = fine.last()?.iteration as f64;
    let train =
        mean(fine.iter().filter(|record| record.iteration as f64 >= 0.9 * last).filter_map(|record| record.psnr))?;
    (train - test > NOT_CONFIRMED).then(|| {
        format!(
            "training views have {train:.1} dB, test views {test:.1}: what was learned is not confirmed from other places or \
             times. Poses, times or exposure of the images may be off (light4gs check shows them; --set train.poses=frame and \
             train.exposure=frame correct small errors), the test views may be far from the others, or motion is seen from one side"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(test: f64, gaussians: usize, curve: impl Fn(f64) -> (f64, f64)) -> Vec<String> {
        let mut config = Config::default();
        config.train.densify.strategies.adaptive.max_gaussians = 1000;
        config.train.densify.strategies.adaptive.until = 500;
        let records: Vec<MetricsRecord> = (1..=100)
            .map(|k| {
                let (train, test) = curve(f64::from(k) / 100.0);
                let mut record = MetricsRecord::new(Stage::Fine, 10 * k as usize, f64::from(k), gaussians);
                (record.psnr, record.test_psnr) = (Some(train), (k % 5 == 0).then_some(test));
                record
            })
            .collect();
        advice(&config, test, &records, Vec::new())
    }

    /// Without a measurement of test views on the way.
    fn run_on_training_views(test: f64, curve: impl Fn(f64) -> f64) -> Vec<String> {
        let record = |k: usize| {
            let mut record = MetricsRecord::new(Stage::Fine, 10 * k, k as f64, 500);
            record.psnr = Some(curve(k as f64 / 100.0));
            record
        };
        advice(&Config::default(), test, &(1..=100).map(record).collect::<Vec<_>>(), Vec::new())
    }

    #[test]
    fn a_good_run_gets_no_advice_and_neither_does_a_bad_one_without_a_reason() {
        assert_eq!(run(35.0, 1000, |at| (45.0, 20.0 + 10.0 * at)), Vec::<String>::new());
        assert_eq!(run(26.0, 500, |_| (28.0, 26.0)), Vec::<String>::new());
        assert_eq!(run(f64::NAN, 1000, |_| (28.0, 26.0)), Vec::<String>::new());
    }

    #[test]
    fn each_fault_is_named() {
        let only =
            |advice: Vec<String>, word: &str| assert!(advice.len() == 1 && advice[0].contains(word), "{advice:?}");
        only(run(26.0, 500, |at| (28.0, 20.0 + 6.0 * at)), "schedule is short");
        only(run_on_training_views(26.0, |at| 20.0 + 8.0 * at), "added 2.0 dB on the training views");
        only(run(26.0, 1000, |_| (28.0, 26.0)), "too few Gaussians");
        only(run(22.0, 500, |_| (31.0, 22.0)), "not confirmed");
        let of_the_capture = |test| advice(&Config::default(), test, &[], vec!["blurred".into()]);
        only(of_the_capture(25.0), "blurred");
        assert_eq!(of_the_capture(35.0), Vec::<String>::new());
    }
}
