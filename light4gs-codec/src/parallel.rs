//! Work on several threads, where there are any. The results do not depend on their number.

/// `work(i)` for every `i` below `count`, in order.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn map<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    use rayon::prelude::*;
    (0..count).into_par_iter().map(work).collect()
}

/// `work(i)` for every `i` below `count`, in order.
#[cfg(target_arch = "wasm32")]
pub(crate) fn map<T>(count: usize, work: impl Fn(usize) -> T) -> Vec<T> {
    (0..count).map(work).collect()
}

/// Sorts numbers of which no two are equal.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn sort<T: Ord + Send>(numbers: &mut [T]) {
    use rayon::prelude::*;
    numbers.par_sort_unstable();
}

/// Sorts numbers of which no two are equal.
#[cfg(target_arch = "wasm32")]
pub(crate) fn sort<T: Ord>(numbers: &mut [T]) {
    numbers.sort_unstable();
}

/// Both results.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
}

/// Both results.
#[cfg(target_arch = "wasm32")]
pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}
