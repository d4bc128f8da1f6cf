//! The functions that JavaScript calls. An instance of the module holds one scene; a worker has one instance.
//!
//! A returned pointer is valid until the next call. Lengths are counts of bytes, of numbers or of Gaussians, as each
//! function says. Only WebAssembly exports the functions under their names: elsewhere `open` is the operating system's.

use std::sync::{Mutex, MutexGuard, PoisonError};

use light4gs_codec::CodecError;

use crate::Arrival;
use crate::description::describe_error;
use crate::draw_list::Viewpoint;
use crate::scene::OpenScene;

#[derive(Default)]
struct State {
    scene: Option<OpenScene>,
    arrival: Option<Arrival>,
    input: Vec<u8>,
    text: String,
    numbers: Vec<f32>,
    list_length: usize,
}

static STATE: Mutex<State> = Mutex::new(State {
    scene: None,
    arrival: None,
    input: Vec::new(),
    text: String::new(),
    numbers: Vec::new(),
    list_length: 0,
});

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Allocates memory for the bytes of a file, and returns its address.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn reserve_input(bytes: usize) -> *mut u8 {
    let mut state = state();
    state.input = vec![0; bytes];
    state.input.as_mut_ptr()
}

/// Decodes the input, and frees it. Returns 1 if it is a scene, else 0. [`text`] has the description or the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn open() -> u32 {
    let state = &mut *state();
    state.scene = None;
    let input = std::mem::take(&mut state.input);
    let opened = OpenScene::decode(&input);
    state.take(opened.map(Some))
}

/// Begins with a file that comes in pieces. The scene that is open stays until something of the file can be seen.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn begin() {
    state().arrival = Some(Arrival::default());
}

/// Takes the input as the next piece of the file, which may be empty, and frees it. Decodes at most one layer. Returns
/// 1 if there is a new scene, with more Gaussians; 2 if not; 0 if the file is damaged. [`text`] has the description or
/// the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn push() -> u32 {
    let state = &mut *state();
    let input = std::mem::take(&mut state.input);
    let pushed = state.arrival.get_or_insert_default().push(&input);
    state.take(pushed)
}

/// Ends the file. Returns 2 if it is complete, else 0; [`text`] has the error.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn finish() -> u32 {
    let state = &mut *state();
    let finished = state.arrival.take().unwrap_or_default().finish();
    state.take(finished.map(|_| None))
}

impl State {
    /// Keeps a scene, where there is a new one, or the error.
    fn take(&mut self, answer: Result<Option<OpenScene>, CodecError>) -> u32 {
        match answer {
            Ok(None) => 2,
            Ok(Some(scene)) => {
                self.text = scene.description().to_owned();
                self.scene = Some(scene);
                1
            }
            Err(error) => {
                self.text = describe_error(&error);
                0
            }
        }
    }
}

/// The description or the error from [`open`], [`push`] and [`finish`], as JSON.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn text() -> *const u8 {
    state().text.as_ptr()
}

/// Number of bytes of [`text`].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn text_length() -> usize {
    state().text.len()
}

/// The digest of the scene that the input decodes to; 0 where it does not decode. The scene that is open stays.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn digest() -> u64 {
    let input = std::mem::take(&mut state().input);
    light4gs_codec::decode(&input).map_or(0, |scene| crate::digest(&scene))
}

/// Chooses the level of detail for [`evaluate`] and [`draw_list`]: 0 is the scene itself. Returns 1 if nothing of it
/// is evaluated yet, else 0.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn show_level(level: u32) -> u32 {
    state().scene.as_mut().map_or(0, |scene| u32::from(scene.show_level(level)))
}

/// The number of Gaussians of the level of [`show_level`].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn count() -> usize {
    state().scene.as_ref().map_or(0, OpenScene::count)
}

/// Computes the Gaussians `first` to `last` at a time in [0, 1].
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn evaluate(time: f32, first: usize, last: usize) {
    if let Some(scene) = &mut state().scene {
        scene.evaluate(time, first, last);
    }
}

/// The Gaussians to draw, back to front, 16 numbers each: center, opacity, covariance xx, xy, xz, yy, yz, zz, color,
/// and three zeros. Filled up to a multiple of 256 Gaussians with zeros. The depth of a point is `x · row_x + y · row_y
/// + z · row_z + row_w`; the camera stands at the eye and sees the cone with this tangent, or all in front of it.
/// [`list_length`] is their number.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn draw_list(
    row_x: f32,
    row_y: f32,
    row_z: f32,
    row_w: f32,
    eye_x: f32,
    eye_y: f32,
    eye_z: f32,
    spread: f32,
) -> *const f32 {
    let viewpoint = Viewpoint { row: [row_x, row_y, row_z, row_w], eye: [eye_x, eye_y, eye_z], spread };
    let state = &mut *state();
    let list = state.scene.as_mut().map_or(&[][..], |scene| scene.draw_list(&viewpoint));
    state.list_length = list.len();
    list.as_ptr()
}

/// The number of numbers that [`draw_list`] returned.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn list_length() -> usize {
    state().list_length
}

/// All attributes at a time. [`numbers_length`] is the number of numbers.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn attributes_at(time: f32) -> *const f32 {
    let state = &mut *state();
    state.numbers = state.scene.as_ref().map(|scene| scene.attributes_at(time)).unwrap_or_default();
    state.numbers.as_ptr()
}

/// The number of numbers that [`attributes_at`] returned.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn numbers_length() -> usize {
    state().numbers.len()
}

/// Frees the memory that [`attributes_at`] returned.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn forget_numbers() {
    state().numbers = Vec::new();
}
