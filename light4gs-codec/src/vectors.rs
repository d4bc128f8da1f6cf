//! Loops in the vectors of the processor at hand.

/// Runs `loops`, compiled a second time for x86-64 processors with vectors of eight numbers (x86-64-v3: AVX2). Other
/// processors and WebAssembly have one kind of vectors, that of the build.
///
/// The bits are the same: the compiler never contracts a product and a sum to one rounding. Functions that `loops`
/// calls must be inlined; others are compiled only for the build's vectors.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(crate) fn vectorized<R>(loops: impl FnOnce() -> R) -> R {
    use std::sync::LazyLock;

    static ARCH: LazyLock<pulp::Arch> = LazyLock::new(pulp::Arch::new);
    ARCH.dispatch(loops)
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub(crate) fn vectorized<R>(loops: impl FnOnce() -> R) -> R {
    loops()
}
