//! Work that waits for a GPU, on a thread of its own, while the trainer launches something else.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

type Task = Box<dyn FnOnce() + Send>;

/// One thread, always the same: CubeCL keeps memory for every thread that uses a GPU.
pub(super) struct Background(Option<Sender<Task>>);

impl Background {
    /// A thread, if `waits`. Without one, work is done when it is waited for.
    pub(super) fn new(waits: bool) -> Self {
        let thread = waits.then(|| {
            let (sender, tasks) = channel::<Task>();
            thread::spawn(move || tasks.into_iter().for_each(|task| task()));
            sender
        });
        Self(thread)
    }

    /// Begins work.
    pub(super) fn begin<R: Send + 'static>(&self, work: impl FnOnce() -> R + Send + 'static) -> Pending<R> {
        let Some(thread) = &self.0 else { return Pending::NotBegun(Box::new(work)) };
        let (sender, result) = channel();
        let task = move || {
            // Nobody waits for it any more if a view has failed.
            let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
        };
        thread.send(Box::new(task)).expect("the thread ends with the sender");
        Pending::Begun(result)
    }
}

/// Work whose result is not there yet.
pub(super) enum Pending<R> {
    NotBegun(Box<dyn FnOnce() -> R + Send>),
    Begun(Receiver<thread::Result<R>>),
}

impl<R> Pending<R> {
    /// The result. A panic of the work continues here.
    pub(super) fn wait(self) -> R {
        match self {
            Self::NotBegun(work) => work(),
            Self::Begun(result) => {
                result.recv().expect("every task sends its result").unwrap_or_else(|panic| resume_unwind(panic))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_and_panics_arrive_with_and_without_a_thread() {
        for waits in [false, true] {
            let background = Background::new(waits);
            let here = thread::current().id();
            let there = background.begin(move || thread::current().id());
            let failing = background.begin(|| -> u32 { std::panic::panic_any("what went wrong") });
            let dropped = background.begin(|| 3);
            drop(dropped);
            assert_eq!(there.wait() == here, !waits);
            let panic = catch_unwind(AssertUnwindSafe(|| failing.wait())).unwrap_err();
            assert_eq!(panic.downcast_ref(), Some(&"what went wrong"));
            assert_eq!(background.begin(|| 2 + 2).wait(), 4);
        }
    }
}
