//! The functions about this library, and about scenes.

use std::ffi::{CStr, c_char};

use light4gs_codec::{Limits, sh_rest_coefficients};
use light4gs_render::PlayableScene;

use crate::caller::{
    self, Picture, check_count, fill_extra, fill_gsplat, fill_inria, handed_out, no_such, refuse_null, taken_back,
};
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
    // SAFETY: the caller's words.
    unsafe {
        handed_out("scene", scene, || {
            let path = caller::path(path)?;
            Ok(L4gsScene::new(PlayableScene::open(path, &caller::limits(limits))?))
        })
    }
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
    // SAFETY: the caller's words.
    unsafe {
        handed_out("scene", scene, || {
            let bytes = caller::bytes(bytes, length)?;
            Ok(L4gsScene::new(PlayableScene::decode(bytes, &caller::limits(limits))?))
        })
    }
}

/// Closes a scene; null is allowed. All pointers that came from it become invalid.
///
/// # Safety
/// `scene` is null, or was opened, has not been closed, and is not in use by another thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_close(scene: *mut L4gsScene) {
    // SAFETY: the caller's words.
    unsafe { taken_back(scene) }
}

/// Fills `*info` with counts and metadata.
///
/// # Safety
/// `scene` is open; `info` points to an `L4gsInfo`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_info(scene: *const L4gsScene, info: *mut L4gsInfo) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let scene = unsafe { caller::open("scene", scene) }?;
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
        name = unsafe { caller::open("scene", scene) }?.name.as_ptr();
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
        let scene = unsafe { caller::open("scene", scene) }?;
        // SAFETY: the caller's words.
        unsafe { fill_extra(&scene.extras, index, key, value) }
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
        let scene = unsafe { caller::open("scene", scene) }?;
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
        let scene = unsafe { caller::open("scene", scene) }?;
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
        let scene = unsafe { caller::open("scene", scene) }?;
        refuse_null("arrays", arrays)?;
        check_count(scene.playable.len(), count)?;
        let found = scene.playable.at(time).map_err(Failure::of_call)?;
        // SAFETY: not null, and the caller says that it points to arrays with room for `count` Gaussians: that is how many there are.
        unsafe { fill_gsplat(&arrays.read(), &found) };
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
        let scene = unsafe { caller::open("scene", scene) }?;
        refuse_null("arrays", arrays)?;
        check_count(scene.playable.len(), count)?;
        let found = scene.playable.at(time).map_err(Failure::of_call)?;
        // SAFETY: not null, and the caller says that it points to arrays with room for `count` Gaussians: that is how many there are.
        unsafe { fill_inria(&arrays.read(), &found) };
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
        unsafe {
            let playable = &caller::open("scene", scene)?.playable;
            let image = Picture { camera, background, image, length };
            image.draw(playable.info(), |camera, background| playable.render(camera, time, background))
        }
    })
}
