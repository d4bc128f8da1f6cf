//! What a caller passes in and gets back: pointers are refused where they are null, and otherwise believed.

use std::ffi::{CStr, CString, c_char};
use std::path::Path;

use glam::{DMat3, DVec3};
use light4gs_codec::{CodecError, GaussianArrays, Limits, StreamInfo};
use light4gs_data::{Camera, Intrinsics};
use light4gs_render::conventions::{Gsplat, Inria};

use crate::failure::{Failure, L4gsStatus, guarded};
use crate::types::{L4gsCamera, L4gsGsplatArrays, L4gsInriaArrays, L4gsLimits};

pub(crate) fn refuse_null<T>(name: &str, pointer: *const T) -> Result<(), Failure> {
    if pointer.is_null() { Err(Failure::argument(format!("{name} is null"))) } else { Ok(()) }
}

pub(crate) fn no_such(what: &str, index: u32, count: usize) -> Failure {
    Failure::argument(format!("{what} {index} of {count}; they are counted from 0"))
}

/// Refuses another number of Gaussians than there are.
pub(crate) fn check_count(there: usize, count: usize) -> Result<(), Failure> {
    if count == there {
        return Ok(());
    }
    Err(Failure::argument(format!("count is {count}, expected the number of Gaussians, {there}")))
}

/// Makes something that then belongs to the caller, to whom `place` points; null where it cannot be made.
///
/// # Safety
/// `place` is null or points to a pointer.
pub(crate) unsafe fn handed_out<T>(
    name: &str,
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> L4gsStatus {
    guarded(|| {
        refuse_null(name, place)?;
        // SAFETY: it is not null, and the caller says that it points to a pointer.
        unsafe { place.write(std::ptr::null_mut()) };
        let made = make()?;
        // SAFETY: as above.
        unsafe { place.write(Box::into_raw(Box::new(made))) };
        Ok(())
    })
}

/// Frees what was handed out.
///
/// # Safety
/// `handed_out` is null, or came from [`handed_out`], and nobody uses it.
pub(crate) unsafe fn taken_back<T>(handed_out: *mut T) {
    guarded(|| {
        if !handed_out.is_null() {
            // SAFETY: it came from `Box::into_raw`, and the caller says that nobody uses it.
            drop(unsafe { Box::from_raw(handed_out) });
        }
        Ok(())
    });
}

/// What was handed out under a name.
///
/// # Safety
/// `handed_out` is null, or came from [`handed_out`] and has not been taken back.
pub(crate) unsafe fn open<'a, T>(name: &str, handed_out: *const T) -> Result<&'a T, Failure> {
    // SAFETY: the caller's words.
    unsafe { handed_out.as_ref() }.ok_or_else(|| Failure::argument(format!("{name} is null")))
}

/// # Safety
/// `limits` is null or points to limits.
pub(crate) unsafe fn limits(limits: *const L4gsLimits) -> Limits {
    // SAFETY: the caller's words.
    unsafe { limits.as_ref() }.map_or_else(Limits::default, |limits| (*limits).into())
}

/// # Safety
/// `bytes` is null or points to `length` bytes that do not change meanwhile.
pub(crate) unsafe fn bytes<'a>(bytes: *const u8, length: usize) -> Result<&'a [u8], Failure> {
    refuse_null("bytes", bytes)?;
    if isize::try_from(length).is_err() {
        return Err(Failure::argument("length is more than the memory of this machine can hold"));
    }
    // SAFETY: not null, not too long, and the caller promises `length` bytes.
    Ok(unsafe { std::slice::from_raw_parts(bytes, length) })
}

/// # Safety
/// `path` is null or a string that ends with a zero and does not change meanwhile.
pub(crate) unsafe fn path<'a>(path: *const c_char) -> Result<&'a Path, Failure> {
    refuse_null("path", path)?;
    // SAFETY: it is not null, and the caller says that it is a string.
    path_of(unsafe { CStr::from_ptr(path) })
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

/// Gives extra entry number `index`.
///
/// # Safety
/// `key` and `value` are null or point to pointers.
pub(crate) unsafe fn fill_extra(
    extras: &[(CString, CString)],
    index: u32,
    key: *mut *const c_char,
    value: *mut *const c_char,
) -> Result<(), Failure> {
    refuse_null("key", key)?;
    refuse_null("value", value)?;
    let entry = extras.get(index as usize);
    let (found_key, found_value) = entry.ok_or_else(|| no_such("extra entry", index, extras.len()))?;
    // SAFETY: neither is null, and the caller says that both point to pointers.
    unsafe {
        key.write(found_key.as_ptr());
        value.write(found_value.as_ptr());
    }
    Ok(())
}

/// # Safety
/// Each array is null or has room for all Gaussians.
pub(crate) unsafe fn fill_gsplat(arrays: &L4gsGsplatArrays, gaussians: &GaussianArrays) {
    let found = Gsplat::of(gaussians);
    // SAFETY: the caller's words.
    unsafe {
        fill(arrays.means, &found.means);
        fill(arrays.quats, &found.quats);
        fill(arrays.scales, &found.scales);
        fill(arrays.opacities, &found.opacities);
        fill(arrays.sh, &found.sh);
    }
}

/// # Safety
/// Each array is null or has room for all Gaussians.
pub(crate) unsafe fn fill_inria(arrays: &L4gsInriaArrays, gaussians: &GaussianArrays) {
    let found = Inria::of(gaussians);
    // SAFETY: the caller's words.
    unsafe {
        fill(arrays.means, &found.means);
        fill(arrays.f_dc, &found.f_dc);
        fill(arrays.f_rest, &found.f_rest);
        fill(arrays.opacity, &found.opacity);
        fill(arrays.scale, &found.scale);
        fill(arrays.rot, &found.rot);
    }
}

/// # Safety
/// `to` is null or points to as many numbers as `from` has. Nobody reads or writes them meanwhile.
unsafe fn fill(to: *mut f32, from: &[f32]) {
    if !to.is_null() {
        // SAFETY: the caller's words; `from` is memory of our own.
        unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), to, from.len()) };
    }
}

/// An image that a caller asks for.
pub(crate) struct Picture {
    pub(crate) camera: *const L4gsCamera,
    /// Null for that of the scene.
    pub(crate) background: *const f32,
    pub(crate) image: *mut f32,
    /// Numbers for which `image` has room.
    pub(crate) length: usize,
}

impl Picture {
    /// Draws the image with `render`, which takes a camera and a background. `scene` has the background where the caller has
    /// none.
    ///
    /// # Safety
    /// `camera` is null or points to a camera; `background` is null or points to three numbers; `image` is null or points to
    /// `length` numbers.
    pub(crate) unsafe fn draw(
        &self,
        scene: &StreamInfo,
        render: impl FnOnce(&Camera, [f32; 3]) -> Result<Vec<f32>, CodecError>,
    ) -> Result<(), Failure> {
        refuse_null("camera", self.camera)?;
        refuse_null("image", self.image)?;
        // SAFETY: not null, and the caller says that it points to a camera.
        let camera = camera_of(&unsafe { self.camera.read() })?;
        let background = if self.background.is_null() {
            scene.meta.background
        } else {
            // SAFETY: not null, and the caller says that it points to three numbers.
            unsafe { self.background.cast::<[f32; 3]>().read() }
        };
        if !background.iter().all(|value| value.is_finite()) {
            return Err(Failure::argument(format!("the background is {background:?}, expected three finite numbers")));
        }
        let needed = 3 * u64::from(camera.width) * u64::from(camera.height);
        if (self.length as u64) < needed {
            return Err(Failure::argument(format!("image has room for {} floats, expected {needed}", self.length)));
        }
        let found = render(&camera, background).map_err(Failure::of_call)?;
        // SAFETY: there is room for `length` numbers, and these are not more.
        unsafe { fill(self.image, &found) };
        Ok(())
    }
}

fn camera_of(camera: &L4gsCamera) -> Result<Camera, Failure> {
    let L4gsCamera { width, height, fx, fy, cx, cy, rotation, translation } = *camera;
    let rotation = DMat3::from_cols_array(&rotation).transpose();
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Camera::from_world_to_camera(rotation, DVec3::from_array(translation), &intrinsics)
        .map_err(|error| Failure::argument(format!("camera: {error}")))
}
