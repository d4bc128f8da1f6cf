//! The functions that JavaScript calls. An instance of the module holds one scene; a worker has one instance.
//!
//! A pointer that is given stays good until the next call. Lengths are counts of bytes, of numbers or of Gaussians, as each
//! function says. Only WebAssembly exports them under their names: elsewhere `open` is the operating system's.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::description::describe_error;
use crate::scene::OpenScene;

#[derive(Default)]
struct State {
    scene: Option<OpenScene>,
    input: Vec<u8>,
    text: String,
    numbers: Vec<f32>,
    order_length: usize,
}

static STATE: Mutex<State> =
    Mutex::new(State { scene: None, input: Vec::new(), text: String::new(), numbers: Vec::new(), order_length: 0 });

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes room for the bytes of a file, and says where they belong.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn reserve_input(bytes: usize) -> *mut u8 {
    let mut state = state();
    state.input = vec![0; bytes];
    state.input.as_mut_ptr()
}

/// Decodes the input, and forgets it. 1 where it is a scene, else 0. [`text`] has the description of either.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn open() -> u32 {
    let state = &mut *state();
    state.scene = None;
    let input = std::mem::take(&mut state.input);
    match OpenScene::decode(&input) {
        Ok(scene) => {
            state.text = scene.description().to_owned();
            state.scene = Some(scene);
            1
        }
        Err(error) => {
            state.text = describe_error(&error);
            0
        }
    }
}

/// What [`open`] has to say: JSON.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn text() -> *const u8 {
    state().text.as_ptr()
}

/// Bytes of [`text`].
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn text_length() -> usize {
    state().text.len()
}

/// The digest of the scene that the input decodes to; 0 where it does not decode. The scene that is open stays.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn digest() -> u64 {
    let input = std::mem::take(&mut state().input);
    light4gs_codec::decode(&input).map_or(0, |scene| crate::digest(&scene))
}

/// Computes the Gaussians `first` to `last` at a time in [0, 1].
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn evaluate(time: f32, first: usize, last: usize) {
    if let Some(scene) = &mut state().scene {
        scene.evaluate(time, first, last);
    }
}

/// Shows what was computed: numbers for the texture, 12 a Gaussian, filled up to a multiple of 256 Gaussians.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn present() -> *const f32 {
    state().scene.as_mut().map_or(std::ptr::null(), |scene| scene.present().as_ptr())
}

/// 1 where harmonics change with time.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn changes_harmonics() -> u32 {
    state().scene.as_ref().is_some_and(OpenScene::changes_harmonics).into()
}

/// The harmonics of what was computed last, for the texture. [`numbers_length`] says how many numbers.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn harmonics() -> *const f32 {
    let state = &mut *state();
    state.numbers = state.scene.as_ref().map(OpenScene::harmonics).unwrap_or_default();
    state.numbers.as_ptr()
}

/// All attributes at a time. [`numbers_length`] says how many numbers.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn attributes_at(time: f32) -> *const f32 {
    let state = &mut *state();
    state.numbers = state.scene.as_ref().map(|scene| scene.attributes_at(time)).unwrap_or_default();
    state.numbers.as_ptr()
}

/// How many numbers [`harmonics`] or [`attributes_at`] gave.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn numbers_length() -> usize {
    state().numbers.len()
}

/// Frees what [`harmonics`] or [`attributes_at`] gave.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn forget_numbers() {
    state().numbers = Vec::new();
}

/// Back to front by depth `x · row.x + y · row.y + z · row.z + offset`: indices. [`order_length`] says how many.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn sort(x: f32, y: f32, z: f32, offset: f32) -> *const u32 {
    let state = &mut *state();
    let order = state.scene.as_mut().map_or(&[][..], |scene| scene.sort([x, y, z, offset]));
    state.order_length = order.len();
    order.as_ptr()
}

/// How many Gaussians [`sort`] gave.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn order_length() -> usize {
    state().order_length
}
