//! Memory, time and panics of one decoding.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind},
    time::Duration,
};

use light4gs_codec::{CodecError, decode, info};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// What a decoding may take at the default limits.
pub const MOST_BYTES: usize = 256 << 20;
/// Likewise.
pub const MOST_TIME: Duration = Duration::from_secs(2);

thread_local! {
    /// Bytes that this thread has taken and not given back, and the most there were.
    static USED: Cell<usize> = const { Cell::new(0) };
    static MOST: Cell<usize> = const { Cell::new(0) };
}

/// Counts the memory of each thread; a binary makes it its global allocator.
#[derive(Debug)]
pub struct CountingAllocator;

fn taken(bytes: usize) {
    USED.with(|used| {
        used.set(used.get().wrapping_add(bytes));
        MOST.with(|most| most.set(most.get().max(used.get())));
    });
}

fn given_back(bytes: usize) {
    USED.with(|used| used.set(used.get().wrapping_sub(bytes)));
}

// SAFETY: every call goes to the system's allocator as it came. The counters are plain cells of the thread, made without
// an allocation and never dropped.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: what the caller promises is what the system asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both are there for a moment.
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

/// What a decoding did.
#[derive(Debug)]
pub struct Outcome {
    /// What the decoder said; nothing where it panicked.
    pub answer: Option<Result<(), CodecError>>,
    /// The most memory that it had at a time, results included.
    pub bytes: usize,
    /// Processor time of the thread.
    pub time: Duration,
}

impl Outcome {
    /// What is wrong with it.
    pub fn fault(&self) -> Option<&'static str> {
        match &self.answer {
            None => Some("panic"),
            Some(Err(error)) if error.is_internal() => Some("internal error"),
            _ if self.bytes > MOST_BYTES => Some("memory"),
            _ if self.time > MOST_TIME => Some("time"),
            _ => None,
        }
    }
}

/// A thread's decoder: whatever it would do on several threads it does on this one.
#[derive(Debug)]
pub struct Decoder {
    pool: ThreadPool,
}

impl Decoder {
    /// For the current thread.
    ///
    /// # Panics
    /// Where the thread belongs to a pool already.
    pub fn on_this_thread() -> Self {
        let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        let decoder = Self { pool: pool.expect("this thread is in no pool yet") };
        // Tables that are made once.
        let _ = decoder.run(&[]);
        decoder
    }

    /// Decodes `bytes` at the default limits, and asks what they hold.
    pub fn run(&self, bytes: &[u8]) -> Outcome {
        let before = USED.get();
        MOST.set(before);
        let begin = processor_time();
        let answer = catch_unwind(AssertUnwindSafe(|| {
            self.pool.install(|| {
                let answer = decode(bytes).map(drop);
                let _ = info(bytes);
                answer
            })
        }));
        Outcome { answer: answer.ok(), time: processor_time() - begin, bytes: MOST.get() - before }
    }
}

/// Processor time of this thread: what others do beside it does not count.
fn processor_time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists on Linux and macOS, and the place to write to is ours.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
