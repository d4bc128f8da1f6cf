//! Many hostile streams: `cargo run --release -p light4gs-hostile -- --inputs 1000000 --threads 2 --seed 1`. With `--what
//! transfers`, streams that come in pieces; with `--what takes`, takes that were damaged or forged.
//!
//! Prints the findings, and saves the bytes of each. `--what records` writes takes with our answers to the standard output, for the
//! readers of `tests/hostile/readers`.

use std::{
    collections::BTreeMap,
    fs,
    io::Write,
    path::PathBuf,
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use light4gs_hostile::{
    Inputs,
    takes::{Takes, record},
    transfers::Transfers,
    watch::{CountingAllocator, Decoder, Outcome},
};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const USAGE: &str = "usage: hostile-streams [--what streams|transfers|takes|records] [--inputs N] [--threads N] [--seed N] [--first N] [--out FOLDER]";
/// Number of inputs between two lines of progress.
const REPORT: u64 = 50_000;

/// The results of all inputs.
#[derive(Default)]
struct Summary {
    sound: u64,
    refused: u64,
    kinds: BTreeMap<&'static str, (u64, u64)>,
    findings: Vec<String>,
    most_bytes: (usize, u64),
    most_time: (Duration, u64),
    time: Duration,
}

impl Summary {
    fn add(&mut self, number: u64, kind: &'static str, outcome: &Outcome) {
        let sound = matches!(outcome.answer, Some(Ok(())));
        self.sound += u64::from(sound);
        self.refused += u64::from(!sound);
        let (all, decoded) = self.kinds.entry(kind).or_default();
        (*all, *decoded) = (*all + 1, *decoded + u64::from(sound));
        self.most_bytes = self.most_bytes.max((outcome.bytes, number));
        self.most_time = self.most_time.max((outcome.time, number));
        self.time += outcome.time;
    }

    fn print(&self, seconds: f64) {
        let (bytes, by_bytes) = self.most_bytes;
        let (time, by_time) = self.most_time;
        println!(
            "{} inputs in {seconds:.0} s: {} decoded, {} refused, {} findings; most memory {:.1} MiB (input {by_bytes}), \
             most time {:.3} s (input {by_time}), mean {:.2} ms",
            self.sound + self.refused,
            self.sound,
            self.refused,
            self.findings.len(),
            bytes as f64 / f64::from(1 << 20),
            time.as_secs_f64(),
            self.time.as_secs_f64() * 1e3 / (self.sound + self.refused).max(1) as f64,
        );
    }
}

/// What is made.
#[derive(Clone, Copy)]
enum What {
    Streams,
    Transfers,
    Takes,
    Records,
}

struct Arguments {
    what: What,
    inputs: u64,
    threads: u64,
    seed: u64,
    first: u64,
    out: PathBuf,
}

fn arguments() -> Result<Arguments, String> {
    let out = "target/hostile-findings".into();
    let mut all = Arguments { what: What::Streams, inputs: 10_000, threads: 1, seed: 1, first: 0, out };
    let mut given = std::env::args().skip(1);
    while let Some(name) = given.next() {
        let value = given.next().ok_or_else(|| format!("{name} needs a value; {USAGE}"))?;
        let number = || value.parse::<u64>().map_err(|_| format!("{name} {value} is no number; {USAGE}"));
        match name.as_str() {
            "--what" => {
                all.what = match value.as_str() {
                    "streams" => What::Streams,
                    "transfers" => What::Transfers,
                    "takes" => What::Takes,
                    "records" => What::Records,
                    _ => return Err(format!("--what {value} is not known; {USAGE}")),
                }
            }
            "--inputs" => all.inputs = number()?,
            "--threads" => all.threads = number()?.clamp(1, 64),
            "--seed" => all.seed = number()?,
            "--first" => all.first = number()?,
            "--out" => all.out = value.into(),
            _ => return Err(format!("unknown argument {name}; {USAGE}")),
        }
    }
    Ok(all)
}

fn main() -> ExitCode {
    let Arguments { what, inputs, threads, seed, first, out } = match arguments() {
        Ok(arguments) => arguments,
        Err(problem) => {
            eprintln!("{problem}");
            return ExitCode::from(2);
        }
    };
    std::panic::set_hook(Box::new(|_| ()));
    if let What::Records = what {
        return write_records(seed, first..first + inputs);
    }
    let (made, next) = (Inputs::new(seed), AtomicU64::new(first));
    let transfers = matches!(what, What::Transfers).then(|| Transfers::new(seed));
    let takes = matches!(what, What::Takes).then(|| Takes::new(seed));
    let (summary, begin) = (Mutex::new(Summary::default()), Instant::now());
    let work = || {
        let decoder = Decoder::on_this_thread();
        let whole = takes.as_ref().map_or_else(Vec::new, |takes| takes.whole(&decoder));
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= first + inputs {
                return;
            }
            let (kind, bytes, outcome) = match (&transfers, &takes) {
                (Some(transfers), _) => {
                    let transfer = transfers.transfer(number);
                    (transfer.kind, transfer.bytes(), transfers.run(&transfer, &decoder))
                }
                (_, Some(takes)) => {
                    let take = takes.take(number);
                    let reading = takes.run(&take, &whole, &decoder);
                    (take.kind, take.bytes, reading.outcome)
                }
                _ => {
                    let (kind, bytes) = made.input(number);
                    let outcome = decoder.run(&bytes);
                    (kind, bytes, outcome)
                }
            };
            let mut summary = summary.lock().unwrap_or_else(PoisonError::into_inner);
            summary.add(number, kind, &outcome);
            if let Some(fault) = outcome.fault() {
                let file = out.join(format!("{seed}-{number}-{}.l4gs", fault.replace(' ', "-")));
                let saved = fs::create_dir_all(&out).and_then(|()| fs::write(&file, &bytes));
                let (mib, seconds) = (outcome.bytes >> 20, outcome.time.as_secs_f64());
                let place = saved.map_or_else(|error| format!("not saved: {error}"), |()| file.display().to_string());
                let line = format!("{fault}: {kind}, {} bytes, {mib} MiB, {seconds:.2} s, {place}", bytes.len());
                println!("{line}");
                summary.findings.push(line);
            }
            if (number + 1 - first).is_multiple_of(REPORT) {
                summary.print(begin.elapsed().as_secs_f64());
            }
        }
    };
    thread::scope(|scope| {
        (0..threads).for_each(|_| {
            scope.spawn(work);
        });
    });
    let summary = summary.into_inner().unwrap_or_else(PoisonError::into_inner);
    println!("\nseed {seed}, inputs {first} to {}", first + inputs);
    for (kind, (all, decoded)) in &summary.kinds {
        println!("{all:9}  {kind} ({decoded} decoded)");
    }
    summary.print(begin.elapsed().as_secs_f64());
    if summary.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Writes takes as records: first the sound ones, then those of these numbers.
fn write_records(seed: u64, numbers: std::ops::Range<u64>) -> ExitCode {
    let (takes, decoder) = (Takes::new(seed), Decoder::on_this_thread());
    let whole = takes.whole(&decoder);
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    let sound = (0..takes.sound_takes()).map(|index| record(index as u64, &takes.sound(index), &whole[index]));
    let changed = numbers.map(|number| {
        let take = takes.take(number);
        record(number, &take, &takes.run(&take, &whole, &decoder).answers)
    });
    for bytes in sound.chain(changed) {
        if let Err(error) = output.write_all(&bytes) {
            // A reader that has seen enough ends.
            eprintln!("cannot write a record: {error}");
            return ExitCode::FAILURE;
        }
    }
    if output.flush().is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
