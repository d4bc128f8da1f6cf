//! The status that a function returns, and the last error, which its thread remembers.

use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::panic::{AssertUnwindSafe, catch_unwind};

use light4gs_codec::CodecError;

/// The status of a call. `l4gs_last_error` and `l4gs_last_error_kind` say more.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum L4gsStatus {
    /// All is well.
    Ok = 0,
    /// An argument is wrong: a null pointer, a time that is not there, an illegal camera, a buffer that is too short.
    Argument = 1,
    /// The operating system refuses to read the file.
    File = 2,
    /// The bytes are no `.l4gs` stream; or they are a take where a scene is expected, or a scene where a take is.
    NotL4gs = 3,
    /// The stream needs a newer version of this library.
    Newer = 4,
    /// The stream is damaged.
    Damaged = 5,
    /// Something is larger than the limits allow.
    OverLimit = 6,
    /// A fault of this library. The scene or take can still be used and closed.
    Internal = 7,
}

/// An error on its way to the caller.
pub(crate) struct Failure {
    status: L4gsStatus,
    kind: &'static str,
    message: String,
}

impl Failure {
    /// A wrong argument.
    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self { status: L4gsStatus::Argument, kind: "argument", message: message.into() }
    }

    /// An error of the codec about an argument, such as the time, not about the stream.
    pub(crate) fn of_call(error: CodecError) -> Self {
        match error {
            CodecError::Invalid { .. } => Self::argument(error.to_string()),
            other => other.into(),
        }
    }
}

impl From<CodecError> for Failure {
    fn from(error: CodecError) -> Self {
        let kind = error.kind();
        let status = match kind {
            "io" => L4gsStatus::File,
            "not-l4gs" | "not-take" | "is-take" => L4gsStatus::NotL4gs,
            "newer-version" | "unknown-section" | "unknown-kind" | "unknown-encoding" | "unknown-attribute" => {
                L4gsStatus::Newer
            }
            "over-limit" => L4gsStatus::OverLimit,
            "self-check" => L4gsStatus::Internal,
            _ => L4gsStatus::Damaged,
        };
        // The message names what opens the file from Rust.
        let here = match kind {
            "is-take" => "; from C l4gs_take_open_file",
            "not-take" => "; from C l4gs_open_file",
            _ => "",
        };
        Self { status, kind, message: format!("{error}{here}") }
    }
}

thread_local! {
    static LAST: RefCell<(CString, CString)> = RefCell::default();
}

/// A C string, without the characters that C cannot hold.
pub(crate) fn c_string(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|&byte| byte != 0).collect();
    CString::new(bytes).unwrap_or_default()
}

/// Runs the body of a function, remembers its error, and stops its panics: they must not pass into C.
pub(crate) fn guarded(body: impl FnOnce() -> Result<(), Failure>) -> L4gsStatus {
    // Whatever a panic leaves behind is an argument of the caller, whose values are then unspecified, or nothing at all.
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return L4gsStatus::Ok,
        Ok(Err(failure)) => failure,
        Err(payload) => {
            let text = payload.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message");
            let message = format!("a fault of light4gs, please report it: {text}");
            Failure { status: L4gsStatus::Internal, kind: "panic", message }
        }
    };
    let texts = (c_string(&failure.message), c_string(failure.kind));
    // While a thread ends there is nobody left to ask.
    let _ = LAST.try_with(|last| last.replace(texts));
    failure.status
}

/// Message or kind of the thread's last error.
pub(crate) fn last(choose: impl Fn(&(CString, CString)) -> &CStr) -> *const std::ffi::c_char {
    LAST.try_with(|last| choose(&last.borrow()).as_ptr()).unwrap_or(c"".as_ptr())
}
