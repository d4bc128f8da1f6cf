//! The functions.

use std::ffi::{CStr, c_char};
use std::path::Path;

use glam::{DMat3, DVec3};
use light4gs_codec::{Limits, sh_rest_coefficients};
use light4gs_data::{Camera, Intrinsics};
use light4gs_render::PlayableScene;
use light4gs_render::conventions::{Gsplat, Inria};

use crate::failure::{Failure, L4gsStatus, guarded, last};
use crate::scene::L4gsScene;
use crate::types::{L4gsCamera, L4gsGsplatArrays, L4gsInfo, L4gsInriaArrays, L4gsLimits};

/// The version of this library, such as "0.1.0". The string lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn l4gs_version() -> *const c_char {
    const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("a version has no zeros"),
    };
    VERSION.as_ptr()
}

/// The message of the last error on this thread, in English; empty if there was none. It is valid until the next error on this
/// thread.
#[unsafe(no_mangle)]
pub extern "C" fn l4gs_last_error() -> *const c_char {
    last(|(message, _)| message)
}

/// The kind of the last error on this thread, in one word that stays the same, such as "checksum" or "over-limit" (docs/bindings.md
/// lists them); empty if there was none. It is valid until the next error on this thread.
#[unsafe(no_mangle)]
pub extern "C" fn l4gs_last_error_kind() -> *const c_char {
    last(|(_, kind)| kind)
}

/// The limits for files of strangers, which hold where null is passed.
#[unsafe(no_mangle)]
pub extern "C" fn l4gs_limits_default() -> L4gsLimits {
    Limits::default().into()
}

/// Limits for files that are trusted, such as your own.
#[unsafe(no_mangle)]
pub extern "C" fn l4gs_limits_large() -> L4gsLimits {
    Limits::large().into()
}

/// Opens a file. On success `*scene` is the scene, which the caller closes with `l4gs_close`; otherwise it is null.
///
/// # Safety
/// `path` is a string that ends with a zero (UTF-8, on Unix any bytes). `limits` is null or points to limits. `scene` points to
/// a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_open_file(
    path: *const c_char,
    limits: *const L4gsLimits,
    scene: *mut *mut L4gsScene,
) -> L4gsStatus {
    guarded(|| {
        refuse_null("scene", scene)?;
        // SAFETY: it is not null, and the caller says that it points to a pointer.
        unsafe { scene.write(std::ptr::null_mut()) };
        refuse_null("path", path)?;
        // SAFETY: it is not null, and the caller says that it is a string.
        let path = unsafe { CStr::from_ptr(path) };
        // SAFETY: the caller's words.
        let limits = unsafe { limits_of(limits) };
        let opened = PlayableScene::open(path_of(path)?, &limits)?;
        // SAFETY: as above.
        unsafe { scene.write(Box::into_raw(Box::new(L4gsScene::new(opened)))) };
        Ok(())
    })
}

/// Opens a stream in memory. The bytes are not needed afterwards. Otherwise as `l4gs_open_file`.
///
/// # Safety
/// `bytes` points to `length` bytes that do not change meanwhile. `limits` is null or points to limits. `scene` points to a
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_open_bytes(
    bytes: *const u8,
    length: usize,
    limits: *const L4gsLimits,
    scene: *mut *mut L4gsScene,
) -> L4gsStatus {
    guarded(|| {
        refuse_null("scene", scene)?;
        // SAFETY: it is not null, and the caller says that it points to a pointer.
        unsafe { scene.write(std::ptr::null_mut()) };
        refuse_null("bytes", bytes)?;
        if isize::try_from(length).is_err() {
            return Err(Failure::argument("length is more than the memory of this machine can hold"));
        }
        // SAFETY: not null, not too long, and the caller promises `length` bytes.
        let bytes = unsafe { std::slice::from_raw_parts(bytes, length) };
        // SAFETY: the caller's words.
        let limits = unsafe { limits_of(limits) };
        let opened = PlayableScene::decode(bytes, &limits)?;
        // SAFETY: as above.
        unsafe { scene.write(Box::into_raw(Box::new(L4gsScene::new(opened)))) };
        Ok(())
    })
}

/// Closes a scene; null is allowed. All pointers that came from it become invalid.
///
/// # Safety
/// `scene` is null, or was opened, has not been closed, and is not in use by another thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_close(scene: *mut L4gsScene) {
    guarded(|| {
        if !scene.is_null() {
            // SAFETY: it came from `Box::into_raw`, and the caller says that nobody uses it.
            drop(unsafe { Box::from_raw(scene) });
        }
        Ok(())
    });
}

/// Fills `*info` with counts and metadata.
///
/// # Safety
/// `scene` is open; `info` points to an `L4gsInfo`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_info(scene: *const L4gsScene, info: *mut L4gsInfo) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("info", info)?;
        let stream = scene.playable.info();
        let meta = &stream.meta;
        let filled = L4gsInfo {
            bytes: stream.bytes,
            gaussians: stream.gaussian_count,
            sh_degree: stream.sh_degree.into(),
            sh_coefficients: 1 + sh_rest_coefficients(stream.sh_degree) as u32,
            frames: meta.frame_count,
            fps: meta.fps,
            bounds_min: meta.bounds[0],
            bounds_max: meta.bounds[1],
            background: meta.background,
            width: meta.width,
            height: meta.height,
            fov_x: meta.fov_x,
            attributes: scene.attributes.len() as u32,
            extras: scene.extras.len() as u32,
            sections: scene.sections.len() as u32,
        };
        // SAFETY: not null, and the caller says that it points to one.
        unsafe { info.write(filled) };
        Ok(())
    })
}

/// The name of the scene, UTF-8, which belongs to the scene; null if `scene` is null.
///
/// # Safety
/// `scene` is null or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_name(scene: *const L4gsScene) -> *const c_char {
    let mut name = std::ptr::null();
    guarded(|| {
        // SAFETY: the caller's words.
        name = unsafe { open(scene) }?.name.as_ptr();
        Ok(())
    });
    name
}

/// Extra entry number `index`, from 0: key and value, UTF-8. Both belong to the scene.
///
/// # Safety
/// `scene` is open; `key` and `value` point to pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_extra(
    scene: *const L4gsScene,
    index: u32,
    key: *mut *const c_char,
    value: *mut *const c_char,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("key", key)?;
        refuse_null("value", value)?;
        let entry = scene.extras.get(index as usize);
        let (found_key, found_value) = entry.ok_or_else(|| no_such("extra entry", index, scene.extras.len()))?;
        // SAFETY: neither is null, and the caller says that both point to pointers.
        unsafe {
            key.write(found_key.as_ptr());
            value.write(found_value.as_ptr());
        }
        Ok(())
    })
}

/// Section number `index`, from 0: its name, which belongs to the scene, and its length in bytes.
///
/// # Safety
/// `scene` is open; `name` and `bytes` point to a pointer and a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_section(
    scene: *const L4gsScene,
    index: u32,
    name: *mut *const c_char,
    bytes: *mut u64,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("name", name)?;
        refuse_null("bytes", bytes)?;
        let section = scene.sections.get(index as usize);
        let (found_name, found_bytes) = section.ok_or_else(|| no_such("section", index, scene.sections.len()))?;
        // SAFETY: neither is null, and the caller says what they point to.
        unsafe {
            name.write(found_name.as_ptr());
            bytes.write(*found_bytes);
        }
        Ok(())
    })
}

/// Attribute number `index`, from 0, of those that not every file has: its name, its numbers for a Gaussian W, and its values
/// `[N, W]`, which do not change with time. Name and values belong to the scene.
///
/// # Safety
/// `scene` is open; `name`, `width` and `values` point to a pointer, a number and a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_attribute(
    scene: *const L4gsScene,
    index: u32,
    name: *mut *const c_char,
    width: *mut u32,
    values: *mut *const f32,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("name", name)?;
        refuse_null("width", width)?;
        refuse_null("values", values)?;
        let attributes = scene.playable.further();
        let attribute = attributes.get(index as usize);
        let attribute = attribute.ok_or_else(|| no_such("attribute", index, attributes.len()))?;
        // SAFETY: none is null, and the caller says what they point to.
        unsafe {
            name.write(scene.attributes[index as usize].as_ptr());
            width.write(attribute.width);
            values.write(attribute.values.as_ptr());
        }
        Ok(())
    })
}

/// Fills the arrays with the Gaussians at a time in [0, 1], as gsplat's `rasterization` takes them. A Gaussian whose quaternion
/// has no direction gets the identity and opacity 0. `count` is the number of Gaussians for which there is room; it must be
/// that of the scene.
///
/// # Safety
/// `scene` is open; `arrays` points to pointers, each of which is null or points to as many numbers as its field says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_gsplat(
    scene: *const L4gsScene,
    time: f32,
    count: usize,
    arrays: *const L4gsGsplatArrays,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("arrays", arrays)?;
        check_count(scene, count)?;
        // SAFETY: not null, and the caller says that it points to them.
        let arrays = unsafe { arrays.read() };
        let found = Gsplat::of(&scene.playable.at(time).map_err(Failure::of_call)?);
        // SAFETY: the caller says that each has room for `count` Gaussians, and that is how many there are.
        unsafe {
            fill(arrays.means, &found.means);
            fill(arrays.quats, &found.quats);
            fill(arrays.scales, &found.scales);
            fill(arrays.opacities, &found.opacities);
            fill(arrays.sh, &found.sh);
        }
        Ok(())
    })
}

/// Fills the arrays with the Gaussians at a time in [0, 1], as the PLY files of the original 3D Gaussian Splatting have them:
/// before the activations, the same bits on every machine. `count` as above.
///
/// # Safety
/// As above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_inria(
    scene: *const L4gsScene,
    time: f32,
    count: usize,
    arrays: *const L4gsInriaArrays,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("arrays", arrays)?;
        check_count(scene, count)?;
        // SAFETY: not null, and the caller says that it points to them.
        let arrays = unsafe { arrays.read() };
        let found = Inria::of(&scene.playable.at(time).map_err(Failure::of_call)?);
        // SAFETY: the caller says that each has room for `count` Gaussians, and that is how many there are.
        unsafe {
            fill(arrays.means, &found.means);
            fill(arrays.f_dc, &found.f_dc);
            fill(arrays.f_rest, &found.f_rest);
            fill(arrays.opacity, &found.opacity);
            fill(arrays.scale, &found.scale);
            fill(arrays.rot, &found.rot);
        }
        Ok(())
    })
}

/// Draws the scene at a time in [0, 1] into `image` `[height, width, 3]`, row-major: red, green, blue, 0 or more and not clamped
/// above. `length` is the number of floats for which there is room. `background` is a color, or null for that of the scene.
///
/// # Safety
/// `scene` is open; `camera` points to a camera; `background` is null or points to three numbers; `image` points to `length`
/// numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_render(
    scene: *const L4gsScene,
    camera: *const L4gsCamera,
    time: f32,
    background: *const f32,
    image: *mut f32,
    length: usize,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { open(scene) }?;
        refuse_null("camera", camera)?;
        refuse_null("image", image)?;
        // SAFETY: not null, and the caller says that it points to a camera.
        let camera = camera_of(&unsafe { camera.read() })?;
        let background = if background.is_null() {
            scene.playable.info().meta.background
        } else {
            // SAFETY: not null, and the caller says that it points to three numbers.
            unsafe { background.cast::<[f32; 3]>().read() }
        };
        if !background.iter().all(|value| value.is_finite()) {
            return Err(Failure::argument(format!("the background is {background:?}, expected three finite numbers")));
        }
        let needed = 3 * u64::from(camera.width) * u64::from(camera.height);
        if (length as u64) < needed {
            return Err(Failure::argument(format!("image has room for {length} floats, expected {needed}")));
        }
        let found = scene.playable.render(&camera, time, background).map_err(Failure::of_call)?;
        // SAFETY: there is room for `length` numbers, and these are not more.
        unsafe { fill(image, &found) };
        Ok(())
    })
}

fn refuse_null<T>(name: &str, pointer: *const T) -> Result<(), Failure> {
    if pointer.is_null() { Err(Failure::argument(format!("{name} is null"))) } else { Ok(()) }
}

fn no_such(what: &str, index: u32, count: usize) -> Failure {
    Failure::argument(format!("{what} {index} of {count}; they are counted from 0"))
}

fn check_count(scene: &L4gsScene, count: usize) -> Result<(), Failure> {
    let expected = scene.playable.len();
    if count == expected {
        return Ok(());
    }
    Err(Failure::argument(format!("count is {count}, expected that of the scene's Gaussians, {expected}")))
}

/// # Safety
/// `scene` is null or open.
unsafe fn open<'a>(scene: *const L4gsScene) -> Result<&'a L4gsScene, Failure> {
    // SAFETY: the caller's words.
    unsafe { scene.as_ref() }.ok_or_else(|| Failure::argument("scene is null"))
}

/// # Safety
/// `limits` is null or points to limits.
unsafe fn limits_of(limits: *const L4gsLimits) -> Limits {
    // SAFETY: the caller's words.
    unsafe { limits.as_ref() }.map_or_else(Limits::default, |limits| (*limits).into())
}

/// # Safety
/// `to` is null or points to as many numbers as `from` has. Nobody reads or writes them meanwhile.
unsafe fn fill(to: *mut f32, from: &[f32]) {
    if !to.is_null() {
        // SAFETY: the caller's words; `from` is memory of our own.
        unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), to, from.len()) };
    }
}

fn camera_of(camera: &L4gsCamera) -> Result<Camera, Failure> {
    let L4gsCamera { width, height, fx, fy, cx, cy, rotation, translation } = *camera;
    let rotation = DMat3::from_cols_array(&rotation).transpose();
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Camera::from_world_to_camera(rotation, DVec3::from_array(translation), &intrinsics)
        .map_err(|error| Failure::argument(format!("camera: {error}")))
}

#[cfg(unix)]
fn path_of(path: &CStr) -> Result<&Path, Failure> {
    use std::os::unix::ffi::OsStrExt;
    Ok(Path::new(std::ffi::OsStr::from_bytes(path.to_bytes())))
}

#[cfg(not(unix))]
fn path_of(path: &CStr) -> Result<&Path, Failure> {
    path.to_str().map(Path::new).map_err(|_| Failure::argument("path is not UTF-8"))
}
