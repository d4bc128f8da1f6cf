//! Memory, time and panics of decoding one stream.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind},
    time::Duration,
};

use light4gs_codec::{CodecError, decode, info};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The memory that decoding may take at the default limits.
pub const MOST_BYTES: usize = 256 << 20;
/// The time that decoding may take at the default limits.
pub const MOST_TIME: Duration = Duration::from_secs(2);

thread_local! {
    /// Bytes that this thread has allocated and not freed, and the largest number of them so far. A thread may free what another
    /// one has allocated, so the number can be below zero.
    static USED: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

/// Counts the memory of each thread. A program makes it its global allocator.
#[derive(Debug)]
pub struct CountingAllocator;

fn taken(bytes: usize) {
    USED.with(|used| {
        used.set(used.get().wrapping_add_unsigned(bytes));
        MOST.with(|most| most.set(most.get().max(used.get())));
    });
}

fn given_back(bytes: usize) {
    USED.with(|used| used.set(used.get().wrapping_sub_unsigned(bytes)));
}

// SAFETY: every call is passed to the system's allocator unchanged. The counters are plain cells of the thread. They
// are made without an allocation and never dropped.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks exist for a short time.
        taken(size);
        given_back(layout.size());
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        given_back(layout.size());
        // SAFETY: the pointer came from `alloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The results of decoding one stream.
#[derive(Debug)]
pub struct Outcome {
    /// The decoder's answer; none if it panicked.
    pub answer: Option<Result<(), CodecError>>,
    /// The largest amount of memory in use at one time, results included.
    pub bytes: usize,
    /// Processor time of the thread.
    pub time: Duration,
    /// What else is wrong.
    pub wrong: Option<&'static str>,
}

impl Outcome {
    /// Everything that is wrong with the results.
    pub fn fault(&self) -> Option<&'static str> {
        match &self.answer {
            None => Some("panic"),
            Some(Err(error)) if error.is_internal() => Some("internal error"),
            _ if self.wrong.is_some() => self.wrong,
            _ if self.bytes > MOST_BYTES => Some("memory"),
            _ if self.time > MOST_TIME => Some("time"),
            _ => None,
        }
    }
}

/// A decoder on one thread: work that it would spread over several threads is done on this one.
#[derive(Debug)]
pub struct Decoder {
    pool: ThreadPool,
}

impl Decoder {
    /// For the current thread.
    ///
    /// # Panics
    /// If the thread already belongs to a pool.
    pub fn on_this_thread() -> Self {
        let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        let decoder = Self { pool: pool.expect("this thread is in no pool yet") };
        // Tables that are made only once.
        let _ = decoder.run(&[]);
        decoder
    }

    /// Decodes `bytes` at the default limits, and reads what they hold.
    pub fn run(&self, bytes: &[u8]) -> Outcome {
        self.watch(|| {
            let answer = decode(bytes).map(drop);
            let _ = info(bytes);
            answer
        })
    }

    /// Watches some decoding.
    pub fn watch(&self, work: impl FnOnce() -> Result<(), CodecError> + Send) -> Outcome {
        let before = USED.get();
        MOST.set(before);
        let begin = processor_time();
        let answer = catch_unwind(AssertUnwindSafe(|| self.pool.install(work)));
        Outcome {
            answer: answer.ok(),
            time: processor_time() - begin,
            bytes: (MOST.get() - before).unsigned_abs(),
            wrong: None,
        }
    }
}

/// Processor time of this thread, so that other threads do not count.
fn processor_time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists on Linux and macOS, and the memory to write to is ours.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
