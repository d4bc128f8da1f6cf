//! The functions about takes. The index comes first, then the base, then segments, which are named by their begins.

use light4gs_codec::CodecError;
use light4gs_codec::take::IndexReader;

use super::{State, state};
use crate::limits::take_limits;
use crate::take::{OpenTake, describe_index, describe_range};

/// Begins with an index, of another file or of one that has grown.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn begin_index() {
    state().index = Some(IndexReader::new(&take_limits()));
}

/// Takes the input as the range of the file that the index needs next, which is the beginning at first, or nothing. Returns 1 if [`text`](super::text)
/// has the next range; 2 if the index is complete; 0 if it has the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn push_index() -> u32 {
    let state = &mut *state();
    let input = std::mem::take(&mut state.input);
    let reader = state.index.get_or_insert_with(|| IndexReader::new(&take_limits()));
    let pushed = if input.is_empty() { Ok(()) } else { reader.push(&input) };
    match pushed.map(|()| reader.needed()) {
        Ok(None) => 2,
        Ok(Some(range)) => state.say(Ok(describe_range(&range))),
        Err(error) => state.say(Err(error)),
    }
}

/// Takes the index, for a file of a length in bytes. What is decoded stays. Returns 1 if [`text`](super::text) has the index; 2
/// if it is not taken, since it is that of another file than before; 0 if there is an error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn finish_index(file_bytes: f64) -> u32 {
    let state = &mut *state();
    let reader = state.index.take().unwrap_or_else(|| IndexReader::new(&take_limits()));
    let index = match reader.finish(file_bytes as u64) {
        Ok(index) => index,
        Err(error) => return state.say(Err(error)),
    };
    let description = describe_index(&index);
    let taken = match &mut state.take {
        Some(take) => take.grow(index),
        none => {
            *none = Some(OpenTake::new(index));
            true
        }
    };
    if taken { state.say(Ok(description)) } else { 2 }
}

/// Decodes the input as the base. Returns 1 if [`text`](super::text) has its description; 0 if it has the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn open_base() -> u32 {
    let state = &mut *state();
    let input = std::mem::take(&mut state.input);
    let opened = state.opened_take().and_then(|take| take.open_base(&input));
    state.say(opened)
}

/// Decodes the input as the bytes of a segment in the file. Returns 1 if [`output`] has what [`open_segment`] takes, in this
/// instance or another; 0 if [`text`](super::text) has the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn unpack_segment(begin: f64) -> u32 {
    let state = &mut *state();
    let input = std::mem::take(&mut state.input);
    let unpacked = state.opened_take().and_then(|take| take.unpack_segment(begin, &input));
    let unpacked = unpacked.map(|bytes| state.output = bytes);
    state.say(unpacked.map(|()| String::new()))
}

/// Opens the input, which [`unpack_segment`] has made. Returns 1 if [`text`](super::text) has the number of Gaussians and
/// that of their levels of detail; 0 if it has the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn open_segment(begin: f64) -> u32 {
    let state = &mut *state();
    let input = std::mem::take(&mut state.input);
    let opened = state.opened_take().and_then(|take| take.open_segment(begin, &input));
    state.say(opened.map(|(count, levels)| format!("{{\"count\":{count},\"levels\":{levels}}}")))
}

/// Frees a segment.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn close_segment(begin: f64) {
    if let Some(take) = &mut state().take {
        take.close_segment(begin);
    }
}

/// The bytes of [`unpack_segment`].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn output() -> *const u8 {
    state().output.as_ptr()
}

/// Number of bytes of [`output`].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn output_length() -> usize {
    state().output.len()
}

/// Frees the bytes of [`output`].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn forget_output() {
    state().output = Vec::new();
}

impl State {
    fn opened_take(&mut self) -> Result<&mut OpenTake, CodecError> {
        self.take.as_mut().ok_or(CodecError::MissingSection { section: "index of the take" })
    }
}
