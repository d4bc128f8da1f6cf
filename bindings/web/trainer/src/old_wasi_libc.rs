//! Functions that Rust's standard library needs from a C library for WASI, and that Debian 12's library of 2022 lacks.
//! They do the same as in the library of `rustup target add wasm32-wasip1`: there are no threads, and links are not
//! followed.

use std::ffi::{c_char, c_int, c_void};

/// WASI's number for "not supported".
const ENOTSUP: c_int = 58;

// SAFETY: nothing else in the program has these names, and none of these functions reads through a pointer that the C
// library does not read as well.
#[unsafe(no_mangle)]
extern "C" fn pthread_create(_: *mut c_void, _: *const c_void, _: *const c_void, _: *mut c_void) -> c_int {
    ENOTSUP
}

#[unsafe(no_mangle)]
extern "C" fn pthread_join(_: *mut c_void, _: *mut *mut c_void) -> c_int {
    ENOTSUP
}

#[unsafe(no_mangle)]
extern "C" fn pthread_detach(_: *mut c_void) -> c_int {
    ENOTSUP
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_init(_: *mut c_void) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_setstacksize(_: *mut c_void, _: usize) -> c_int {
    0
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_destroy(_: *mut c_void) -> c_int {
    0
}

unsafe extern "C" {
    fn strdup(text: *const c_char) -> *mut c_char;
}

/// The path itself, in memory that the caller frees; the standard library passes no memory of its own.
#[unsafe(no_mangle)]
unsafe extern "C" fn realpath(path: *const c_char, _: *mut c_char) -> *mut c_char {
    // SAFETY: the caller gives a text that ends with 0.
    unsafe { strdup(path) }
}
