//! The allocator's settings for training.

/// Tells glibc to keep what is freed. A training step takes and frees the same tens of megabytes over and over; given
/// back to the system, every page of them would be fetched and zeroed anew. The program `light4gs` calls this first; a
/// program of one's own that trains may do so too. On other systems, and with another allocator, it does nothing.
///
/// # Safety
/// No other thread may run yet: call it at the beginning of `main`.
pub unsafe fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        /// The largest that glibc takes; larger blocks are given back.
        const LARGEST_KEPT_BLOCK: libc::c_int = 32 << 20;
        const LARGEST_KEPT_REST: libc::c_int = 1 << 30;
        // SAFETY: the caller promises that no other thread runs, and both settings may have any value; one that is refused
        // changes nothing.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGEST_KEPT_BLOCK);
            libc::mallopt(libc::M_TRIM_THRESHOLD, LARGEST_KEPT_REST);
        }
    }
}
