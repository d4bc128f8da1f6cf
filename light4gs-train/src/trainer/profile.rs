//! `--profile`: the time of each part of a training step, on any back end.

use std::cell::RefCell;
use std::time::Instant;

use burn::tensor::Device;

use crate::report::table::{Align, Table};

/// Steps that are not counted, since they compile kernels and fill caches.
const WARM_UP: usize = 3;

/// A stopwatch with a total for every part. Switched off, it costs nothing and never waits for the device.
#[derive(Debug)]
pub struct Profile {
    laps: Option<RefCell<Laps>>,
}

#[derive(Debug)]
struct Laps {
    device: Device,
    last: Instant,
    steps: usize,
    /// Seconds, in the order in which the parts first occurred.
    parts: Vec<(&'static str, f64)>,
}

impl Profile {
    /// A stopwatch that does nothing.
    pub fn off() -> Self {
        Self { laps: None }
    }

    /// A stopwatch that waits for the device at the end of every part, so that each part's time is its own.
    pub fn on(device: &Device) -> Self {
        let laps = Laps { device: device.clone(), last: Instant::now(), steps: 0, parts: Vec::new() };
        Self { laps: Some(RefCell::new(laps)) }
    }

    /// Begins a step.
    pub fn begin_step(&self) {
        let Some(laps) = &self.laps else { return };
        let mut laps = laps.borrow_mut();
        laps.wait();
        laps.steps += 1;
        laps.last = Instant::now();
    }

    /// Ends a part and begins the next one.
    pub fn lap(&self, part: &'static str) {
        let Some(laps) = &self.laps else { return };
        let mut laps = laps.borrow_mut();
        laps.wait();
        let now = Instant::now();
        let seconds = (now - laps.last).as_secs_f64();
        laps.last = now;
        if laps.steps <= WARM_UP {
            return;
        }
        match laps.parts.iter_mut().find(|(name, _)| *name == part) {
            Some((_, total)) => *total += seconds,
            None => laps.parts.push((part, seconds)),
        }
    }

    /// Milliseconds of each part of a step; `None` if switched off, or with too few steps.
    pub fn table(&self) -> Option<String> {
        let laps = self.laps.as_ref()?.borrow();
        let steps = laps.steps.checked_sub(WARM_UP).filter(|steps| *steps > 0)?;
        let total: f64 = laps.parts.iter().map(|(_, seconds)| seconds).sum();
        let mut table = Table::new([("part", Align::Left), ("ms a step", Align::Right), ("share", Align::Right)]);
        let row = |name: &str, seconds: f64| {
            [name.to_owned(), format!("{:.2}", 1e3 * seconds / steps as f64), format!("{:.1} %", 1e2 * seconds / total)]
        };
        for (name, seconds) in &laps.parts {
            table.row(row(name, *seconds));
        }
        table.rule().row(row("step", total));
        Some(format!("{table}\n{steps} steps, {WARM_UP} before them not counted"))
    }
}

impl Laps {
    fn wait(&self) {
        // A device that cannot wait has nothing to wait for.
        let _ = self.device.sync();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_add_up_after_the_warm_up() {
        let profile = Profile::on(&Device::flex());
        assert!(profile.table().is_none());
        for _ in 0..WARM_UP + 2 {
            profile.begin_step();
            profile.lap("forward");
            profile.lap("backward");
        }
        let table = profile.table().unwrap();
        assert!(table.contains("forward") && table.contains("backward") && table.contains("2 steps"), "{table}");
        assert!(Profile::off().table().is_none());
    }
}
