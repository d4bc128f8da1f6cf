//! Hostile inputs, hundreds of them, made from a seed.
//!
//! `LIGHT4GS_HOSTILE_CASES` sets how many cases each test makes (the tests themselves have a short run for CI), and
//! `LIGHT4GS_HOSTILE_SEED` sets the seed.

pub mod bytes;
pub mod checkpoints;
pub mod configurations;
pub mod json;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use light4gs_data::Scene;
use light4gs_train::config::Config;
use light4gs_train::dataset::load_options;
use light4gs_train::error::TrainError;
use light4gs_train::trainer::Trainer;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Number of cases that a test makes: the number in the environment, or `short`.
pub fn cases(short: usize) -> usize {
    number("LIGHT4GS_HOSTILE_CASES").map_or(short, |cases| cases as usize)
}

/// The random generator of a case.
pub fn generator(case: usize) -> ChaCha8Rng {
    let seed = number("LIGHT4GS_HOSTILE_SEED").unwrap_or(0);
    ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(case as u64))
}

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable} is `{text}`, expected a number")))
}

/// Runs something that may refuse its input but must not panic. `what` says what the input was.
#[track_caller]
pub fn without_panic<T>(what: &str, action: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(action)).unwrap_or_else(|_| panic!("panicked on: {what}"))
}

/// Trains a few iterations without a folder, and makes the file of the result.
///
/// # Errors
/// The error that the program would print.
pub fn train(config: &Config, scene: &Path, iterations: usize) -> Result<(), TrainError> {
    let data = Scene::open(scene, &load_options(config))?;
    let mut trainer = Trainer::builder(config.clone(), data).build()?;
    for _ in 0..iterations {
        trainer.step()?;
    }
    trainer.encode().map(drop)
}

/// Runs a command to its end, or stops it after a time limit.
#[track_caller]
pub fn run_within(command: &mut Command, limit: Duration, what: &str) -> Output {
    let mut child: Child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let begin = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if begin.elapsed() > limit {
            child.kill().expect("it is ours");
            panic!("still running after {limit:?}: {what}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().expect("a child")
}

/// Fails unless the program ended well, or refused its input with a message fit for a terminal.
#[track_caller]
pub fn assert_bearable(output: &Output, what: &str) {
    let text = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 2)), "exit {:?} on {what}: {text}", output.status);
    assert!(!text.contains("panicked"), "{what}: {text}");
    let raw = |c: char| c.is_control() && c != '\n' && c != '\t';
    assert!(!text.contains(raw), "control characters reach the terminal on {what}: {text:?}");
    assert!(code == Some(0) || text.contains("error: "), "refused without a word on {what}: {text}");
}
