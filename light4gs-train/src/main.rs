//! The binary `light4gs`.

fn main() -> std::process::ExitCode {
    keep_freed_memory();
    light4gs_train::cli::main()
}

/// Tells glibc to keep what is freed. A training step takes and frees the same tens of megabytes over and over; given
/// back to the system, every page of them would be fetched and zeroed anew.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn keep_freed_memory() {
    /// The largest that glibc takes; larger blocks are given back.
    const LARGEST_KEPT_BLOCK: libc::c_int = 32 << 20;
    const LARGEST_KEPT_REST: libc::c_int = 1 << 30;
    // SAFETY: no other thread runs yet, and both settings may have any value; one that is refused changes nothing.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, LARGEST_KEPT_BLOCK);
        libc::mallopt(libc::M_TRIM_THRESHOLD, LARGEST_KEPT_REST);
    }
}

/// Other allocators have settings of their own.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep_freed_memory() {}
