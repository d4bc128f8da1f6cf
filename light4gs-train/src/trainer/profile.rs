//! `--profile`: the time of each part of a training step on any back end, and the number of busy threads in it.

use std::cell::RefCell;
use std::time::Instant;

use burn::tensor::Device;

use crate::table::{Align, Table};

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
    /// Processor time of the process at that moment, where the system tells it.
    last_work: Option<f64>,
    steps: usize,
    /// In the order in which they first occurred.
    parts: Vec<Part>,
}

#[derive(Debug)]
struct Part {
    name: &'static str,
    /// Seconds, of each time that it was measured.
    laps: Vec<f64>,
    /// Seconds of all threads together.
    work: f64,
}

impl Part {
    /// Seconds in all.
    fn time(&self) -> f64 {
        self.laps.iter().sum()
    }
}

/// The processor time of all threads of the process so far, in seconds. `None` where the system does not tell it.
fn processor_time() -> Option<f64> {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: the structure outlives the call, which writes nothing else.
        let told = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) } == 0;
        told.then_some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    None
}

/// The share of the work that only one thread does, by Amdahl's law, if `busy` of the threads are busy in the mean.
fn serial_share(busy: f64, threads: usize) -> f64 {
    let parallel = 1.0 / threads as f64;
    ((1.0 / busy - parallel) / (1.0 - parallel)).clamp(0.0, 1.0)
}

impl Profile {
    /// A stopwatch that does nothing.
    pub fn off() -> Self {
        Self { laps: None }
    }

    /// A stopwatch that waits for the device at the end of every part, so that each part's time is its own.
    pub fn on(device: &Device) -> Self {
        let (last, last_work) = (Instant::now(), processor_time());
        Self { laps: Some(RefCell::new(Laps { device: device.clone(), last, last_work, steps: 0, parts: Vec::new() })) }
    }

    /// Begins a step.
    pub fn begin_step(&self) {
        let Some(laps) = &self.laps else { return };
        let mut laps = laps.borrow_mut();
        laps.wait();
        laps.steps += 1;
        laps.last = Instant::now();
        laps.last_work = processor_time();
    }

    /// Ends a part and begins the next one.
    pub fn lap(&self, part: &'static str) {
        let Some(laps) = &self.laps else { return };
        let mut laps = laps.borrow_mut();
        laps.wait();
        let (now, work_now) = (Instant::now(), processor_time());
        let time = (now - laps.last).as_secs_f64();
        let work = work_now.zip(laps.last_work).map_or(0.0, |(now, last)| now - last);
        (laps.last, laps.last_work) = (now, work_now);
        if laps.steps <= WARM_UP {
            return;
        }
        match laps.parts.iter_mut().find(|other| other.name == part) {
            Some(total) => {
                total.laps.push(time);
                total.work += work;
            }
            None => laps.parts.push(Part { name: part, laps: vec![time], work }),
        }
    }

    /// Seconds of a part, each time that it was measured after the warm-up: `"Adam"`, once a step. Empty where it never was.
    pub fn laps(&self, part: &str) -> Vec<f64> {
        let laps = self.laps.as_ref().map(|laps| laps.borrow());
        let part = laps.as_ref().and_then(|laps| laps.parts.iter().find(|other| other.name == part));
        part.map(|part| part.laps.clone()).unwrap_or_default()
    }

    /// Milliseconds of each part of a step, busy threads where the system tells them, and what more threads could give; `None` if
    /// switched off, or with too few steps.
    pub fn table(&self) -> Option<String> {
        let laps = self.laps.as_ref()?.borrow();
        let steps = laps.steps.checked_sub(WARM_UP).filter(|steps| *steps > 0)?;
        let of_all = |number: fn(&Part) -> f64| laps.parts.iter().map(number).sum::<f64>();
        let step = Part { name: "step", laps: vec![of_all(Part::time)], work: of_all(|part| part.work) };
        let is_told = laps.last_work.is_some();
        let mut columns = vec![("part", Align::Left), ("ms per step", Align::Right), ("share", Align::Right)];
        columns.extend(is_told.then_some(("threads busy", Align::Right)));
        let mut table = Table::new(columns);
        let row = |part: &Part| {
            let milliseconds = format!("{:.2}", 1e3 * part.time() / steps as f64);
            let share = format!("{:.1} %", 1e2 * part.time() / step.time());
            let busy = is_told.then(|| format!("{:.2}", part.work / part.time()));
            [part.name.to_owned(), milliseconds, share].into_iter().chain(busy)
        };
        for part in &laps.parts {
            table.row(row(part));
        }
        table.rule().row(row(&step));
        let mut text = format!("{table}\n{steps} steps, {WARM_UP} before them not counted");
        let threads = rayon::current_num_threads();
        if is_told && threads > 1 {
            let serial = serial_share(step.work / step.time(), threads);
            let on_sixteen = serial + (1.0 - serial) / 16.0;
            text += &format!(
                "\n{:.0} % of the work is serial (Amdahl's law, {threads} threads): on 16 cores a step would take {:.0} % of its work",
                1e2 * serial,
                1e2 * on_sixteen,
            );
        }
        Some(text)
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
    fn what_is_serial_follows_from_busy_threads() {
        assert_eq!(serial_share(1.0, 2), 1.0);
        assert_eq!(serial_share(4.0, 4), 0.0);
        // A half serial: on two threads three quarters of the time of one.
        assert!((serial_share(4.0 / 3.0, 2) - 0.5).abs() < 1e-12);
    }

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
