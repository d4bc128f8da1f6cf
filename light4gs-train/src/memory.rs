//! The allocator's settings for training.

/// Tells glibc to keep freed memory. A training step allocates and frees the same tens of megabytes again and again; if
/// they were given back to the system, every page would be requested and zeroed anew. The program `light4gs` calls this
/// first, and other programs that train may call it too. On other systems, and with another allocator, it does nothing.
///
/// # Safety
/// No other thread may run yet: call it at the beginning of `main`.
pub unsafe fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const LARGEST_KEPT_REST: libc::c_int = 1 << 30;
        // SAFETY: the caller promises that no other thread runs, and both settings may have any value; a value that is
        // refused changes nothing.
        unsafe {
            // No block gets a mapping of its own, which would be given back: with a million Gaussians a tensor has 256 MB.
            libc::mallopt(libc::M_MMAP_MAX, 0);
            libc::mallopt(libc::M_TRIM_THRESHOLD, LARGEST_KEPT_REST);
        }
    }
}
