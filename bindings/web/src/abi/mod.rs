//! The functions that JavaScript calls. An instance of the module holds one scene or one take; a worker has one instance.
//!
//! A returned pointer is valid until the next call. Lengths are counts of bytes, of numbers or of Gaussians, as each
//! function says. Only WebAssembly exports the functions under their names: elsewhere `open` is the operating system's.

pub mod take;

use std::sync::{Mutex, MutexGuard, PoisonError};

use light4gs_codec::CodecError;
use light4gs_codec::take::IndexReader;

use crate::Arrival;
use crate::description::describe_error;
use crate::draw_list::Viewpoint;
use crate::scene::OpenScene;
use crate::take::OpenTake;

#[derive(Default)]
struct State {
    scene: Option<OpenScene>,
    arrival: Option<Arrival>,
    /// Where there is a take, it is shown in place of the scene.
    take: Option<OpenTake>,
    index: Option<IndexReader>,
    input: Vec<u8>,
    output: Vec<u8>,
    text: String,
    numbers: Vec<f32>,
    numbers_degree: u8,
    list_length: usize,
}

static STATE: Mutex<State> = Mutex::new(State {
    scene: None,
    arrival: None,
    take: None,
    index: None,
    input: Vec::new(),
    output: Vec::new(),
    text: String::new(),
    numbers: Vec::new(),
    numbers_degree: 0,
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
    /// Keeps what is said of an answer, or the error, and returns whether it is an answer.
    fn say(&mut self, answer: Result<String, CodecError>) -> u32 {
        let good = u32::from(answer.is_ok());
        self.text = answer.unwrap_or_else(|error| describe_error(&error));
        good
    }

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

/// Chooses what [`evaluate`] and [`draw_list`] are about: a level of detail, where 0 has all Gaussians, and of a take the
/// segment of a time in seconds. Returns 1 if nothing of it is evaluated yet, else 0.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn show(level: u32, time: f64) -> u32 {
    let state = &mut *state();
    let new = match (&mut state.take, &mut state.scene) {
        (Some(take), _) => take.show(time, level),
        (None, Some(scene)) => scene.show_level(level),
        (None, None) => false,
    };
    u32::from(new)
}

/// The number of Gaussians that [`evaluate`] moves.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn count() -> usize {
    let state = state();
    state.take.as_ref().map_or_else(|| state.scene.as_ref().map_or(0, OpenScene::count), OpenTake::count)
}

/// Computes the Gaussians `first` to `last` at a time: in [0, 1] of a scene, in seconds of a take.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn evaluate(time: f64, first: usize, last: usize) {
    let state = &mut *state();
    match (&mut state.take, &mut state.scene) {
        (Some(take), _) => take.evaluate(time, first, last),
        (None, Some(scene)) => scene.evaluate(time as f32, first, last),
        (None, None) => {}
    }
}

/// The Gaussians to draw, back to front, 16 numbers each: center, opacity, covariance xx, xy, xz, yy, yz, zz, color,
/// and three zeros. Filled up to a multiple of 256 Gaussians with zeros. The depth of a point is `x · row_x + y · row_y
/// + z · row_z + row_w`; the camera stands at the eye and sees the cone with this tangent, or all in front of it.
/// `only` chooses a segment of a take around a join, where [`weight_of_later`] is not 0: the base is listed with the earlier one
/// for 1 and with the later one for 2; with both for 0. [`list_length`] is the number of numbers.
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
    only: usize,
) -> *const f32 {
    let viewpoint = Viewpoint { row: [row_x, row_y, row_z, row_w], eye: [eye_x, eye_y, eye_z], spread };
    let state = &mut *state();
    let list = match (&mut state.take, &mut state.scene) {
        (Some(take), _) => match only.checked_sub(1) {
            None => take.draw_list(&viewpoint),
            Some(place) => take.draw_list_with(place, &viewpoint),
        },
        (None, Some(scene)) => scene.draw_list(&viewpoint),
        (None, None) => &[],
    };
    state.list_length = list.len();
    list.as_ptr()
}

/// Around a join of a take, the weight of the later of two segments: the picture is the mean of the pictures with either, by
/// their weights. 0 elsewhere.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn weight_of_later() -> f32 {
    state().take.as_ref().map_or(0.0, OpenTake::weight_of_later)
}

/// The number of numbers that [`draw_list`] returned.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn list_length() -> usize {
    state().list_length
}

/// All attributes at a time, as for [`evaluate`]. [`numbers_length`] is the number of numbers, [`numbers_degree`] the degree
/// of the harmonics.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn attributes_at(time: f64) -> *const f32 {
    let state = &mut *state();
    (state.numbers, state.numbers_degree) = match (&state.take, &state.scene) {
        (Some(take), _) => take.attributes_at(time),
        (None, Some(scene)) => (scene.attributes_at(time as f32), scene.sh_degree()),
        (None, None) => Default::default(),
    };
    state.numbers.as_ptr()
}

/// The degree of the harmonics that [`attributes_at`] returned.
#[cfg_attr(target_os = "unknown", unsafe(no_mangle))]
pub extern "C" fn numbers_degree() -> u32 {
    state().numbers_degree.into()
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
