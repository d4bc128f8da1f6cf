//! The functions about takes.

use std::ffi::c_char;

use light4gs_codec::sh_rest_coefficients;
use light4gs_codec::take::SegmentPlace;
use light4gs_render::PlayableTake;

use crate::caller::{
    self, Picture, check_count, fill_extra, fill_gsplat, fill_inria, handed_out, no_such, refuse_null, taken_back,
};
use crate::failure::{Failure, L4gsStatus, guarded};
use crate::take::{L4gsGaussians, L4gsTake};
use crate::types::{L4gsCamera, L4gsCounts, L4gsGsplatArrays, L4gsInriaArrays, L4gsLimits, L4gsTakeInfo};

/// Opens a file that is a take: minutes in one file, as a base that stands still and segments in time. Its index and its base are
/// read; segments are read and decoded when they are needed. On success `*take` is the take, which the caller closes with
/// `l4gs_take_close`; otherwise it is null. A file of one scene gets `L4GS_STATUS_NOT_L4GS`, of the kind "not-take"; for
/// `l4gs_open_file` it is the other way round, and the kind is "is-take".
///
/// `kept` is the most segments that are kept decoded, those that were used last, and at least two, as two are drawn around a join; 0 means three, which are the one that is shown
/// and those beside it. The file must stay there and may grow; segments that are appended are seen by who opens it again.
///
/// # Safety
/// `path` is a string that ends with a zero (UTF-8, on Unix any bytes). `limits` is null or points to limits. `take` points to
/// a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_open_file(
    path: *const c_char,
    limits: *const L4gsLimits,
    kept: u32,
    take: *mut *mut L4gsTake,
) -> L4gsStatus {
    // SAFETY: the caller's words.
    unsafe {
        handed_out("take", take, || {
            let path = caller::path(path)?;
            Ok(L4gsTake::new(PlayableTake::open(path, &caller::limits(limits))?, kept))
        })
    }
}

/// Opens a take in memory, of which it keeps a copy: the bytes are not needed afterwards. Otherwise as `l4gs_take_open_file`.
///
/// # Safety
/// `bytes` points to `length` bytes that do not change meanwhile. `limits` is null or points to limits. `take` points to a
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_open_bytes(
    bytes: *const u8,
    length: usize,
    limits: *const L4gsLimits,
    kept: u32,
    take: *mut *mut L4gsTake,
) -> L4gsStatus {
    // SAFETY: the caller's words.
    unsafe {
        handed_out("take", take, || {
            let bytes = caller::bytes(bytes, length)?;
            Ok(L4gsTake::new(PlayableTake::decode(bytes.to_vec(), &caller::limits(limits))?, kept))
        })
    }
}

/// Closes a take; null is allowed. All pointers that came from it become invalid, but for Gaussians of a time.
///
/// # Safety
/// `take` is null, or was opened, has not been closed, and is not in use by another thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_close(take: *mut L4gsTake) {
    // SAFETY: the caller's words.
    unsafe { taken_back(take) }
}

/// Fills `*info` with counts and metadata.
///
/// # Safety
/// `take` is open; `info` points to an `L4gsTakeInfo`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_info(take: *const L4gsTake, info: *mut L4gsTakeInfo) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let take = unsafe { caller::open("take", take) }?;
        refuse_null("info", info)?;
        let (index, base) = (take.playable.take().index(), take.playable.base().info());
        let filled = L4gsTakeInfo {
            seconds: index.seconds(),
            fps: index.meta().fps,
            segments: index.segments().len() as u32,
            extras: take.extras.len() as u32,
            gaussians: base.gaussian_count,
            bounds_min: base.meta.bounds[0],
            bounds_max: base.meta.bounds[1],
            background: base.meta.background,
            width: base.meta.width,
            height: base.meta.height,
            fov_x: base.meta.fov_x,
        };
        // SAFETY: not null, and the caller says that it points to one.
        unsafe { info.write(filled) };
        Ok(())
    })
}

/// The name of the take, UTF-8, which belongs to the take; null if `take` is null.
///
/// # Safety
/// `take` is null or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_name(take: *const L4gsTake) -> *const c_char {
    let mut name = std::ptr::null();
    guarded(|| {
        // SAFETY: the caller's words.
        name = unsafe { caller::open("take", take) }?.name.as_ptr();
        Ok(())
    });
    name
}

/// Extra entry number `index`, from 0: key and value, UTF-8. Both belong to the take.
///
/// # Safety
/// `take` is open; `key` and `value` point to pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_extra(
    take: *const L4gsTake,
    index: u32,
    key: *mut *const c_char,
    value: *mut *const c_char,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        unsafe { fill_extra(&caller::open("take", take)?.extras, index, key, value) }
    })
}

/// Segment number `index`, from 0, by rising begins: it is shown from `*begin` on and before `*end`, in seconds of the take. There
/// may be gaps between segments.
///
/// # Safety
/// `take` is open; `begin` and `end` point to numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_segment(
    take: *const L4gsTake,
    index: u32,
    begin: *mut f64,
    end: *mut f64,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let take = unsafe { caller::open("take", take) }?;
        refuse_null("begin", begin)?;
        refuse_null("end", end)?;
        let segments = take.playable.take().index().segments();
        let SegmentPlace { times, .. } =
            segments.get(index as usize).ok_or_else(|| no_such("segment", index, segments.len()))?;
        // SAFETY: neither is null, and the caller says that both point to numbers.
        unsafe {
            begin.write(times.begin);
            end.write(times.end);
        }
        Ok(())
    })
}

/// Decodes what is shown at a time in seconds, so that it is there when it is needed: for a thread that runs ahead of the one
/// that draws. Nothing happens where no segment is shown. Several threads can decode segments at the same time.
///
/// # Safety
/// `take` is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_prepare(take: *const L4gsTake, seconds: f64) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        unsafe { caller::open("take", take) }?.playable.prepare(seconds).map_err(Failure::of_call)
    })
}

/// Computes the Gaussians at a time in seconds: those of the base that are not hidden, and those of the segment; those of the base
/// alone where no segment is. Their number changes from segment to segment, so they come as an object of their own: ask it for
/// its counts, and copy what is wanted. On success the caller closes `*gaussians` with `l4gs_gaussians_close`; otherwise it is
/// null.
///
/// # Safety
/// `take` is open; `gaussians` points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_gaussians(
    take: *const L4gsTake,
    seconds: f64,
    gaussians: *mut *mut L4gsGaussians,
) -> L4gsStatus {
    // SAFETY: the caller's words.
    unsafe {
        handed_out("gaussians", gaussians, || {
            caller::open("take", take)?.playable.at(seconds).map(L4gsGaussians).map_err(Failure::of_call)
        })
    }
}

/// Fills `*counts` with the number of the Gaussians and the degree of their harmonics.
///
/// # Safety
/// `gaussians` is open; `counts` points to an `L4gsCounts`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_counts(gaussians: *const L4gsGaussians, counts: *mut L4gsCounts) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let L4gsGaussians(found) = unsafe { caller::open("gaussians", gaussians) }?;
        refuse_null("counts", counts)?;
        let filled = L4gsCounts {
            gaussians: found.len() as u32,
            sh_degree: found.sh_degree.into(),
            sh_coefficients: 1 + sh_rest_coefficients(found.sh_degree) as u32,
        };
        // SAFETY: not null, and the caller says that it points to one.
        unsafe { counts.write(filled) };
        Ok(())
    })
}

/// Fills the arrays with the Gaussians, in the convention of `l4gs_gaussians_gsplat`. `count` is the number of Gaussians for which
/// there is room; it must be that of `l4gs_gaussians_counts`.
///
/// # Safety
/// `gaussians` is open; `arrays` points to pointers, each of which is null or points to as many numbers as its field says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_copy_gsplat(
    gaussians: *const L4gsGaussians,
    count: usize,
    arrays: *const L4gsGsplatArrays,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let L4gsGaussians(found) = unsafe { caller::open("gaussians", gaussians) }?;
        refuse_null("arrays", arrays)?;
        check_count(found.len(), count)?;
        // SAFETY: not null, and the caller says that it points to arrays with room for `count` Gaussians: that is how many there are.
        unsafe { fill_gsplat(&arrays.read(), found) };
        Ok(())
    })
}

/// Fills the arrays with the Gaussians, in the convention of `l4gs_gaussians_inria`: the same bits on every machine. `count` as
/// above.
///
/// # Safety
/// As above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_copy_inria(
    gaussians: *const L4gsGaussians,
    count: usize,
    arrays: *const L4gsInriaArrays,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        let L4gsGaussians(found) = unsafe { caller::open("gaussians", gaussians) }?;
        refuse_null("arrays", arrays)?;
        check_count(found.len(), count)?;
        // SAFETY: not null, and the caller says that it points to arrays with room for `count` Gaussians: that is how many there are.
        unsafe { fill_inria(&arrays.read(), found) };
        Ok(())
    })
}

/// Closes the Gaussians of a time; null is allowed.
///
/// # Safety
/// `gaussians` is null, or came from `l4gs_take_gaussians`, has not been closed, and is not in use by another thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_gaussians_close(gaussians: *mut L4gsGaussians) {
    // SAFETY: the caller's words.
    unsafe { taken_back(gaussians) }
}

/// Draws the take at a time in seconds into `image`. Otherwise as `l4gs_render`; the background is that of the base where
/// `background` is null.
///
/// # Safety
/// `take` is open; `camera` points to a camera; `background` is null or points to three numbers; `image` points to `length`
/// numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn l4gs_take_render(
    take: *const L4gsTake,
    camera: *const L4gsCamera,
    seconds: f64,
    background: *const f32,
    image: *mut f32,
    length: usize,
) -> L4gsStatus {
    guarded(|| {
        // SAFETY: the caller's words.
        unsafe {
            let playable = &caller::open("take", take)?.playable;
            let image = Picture { camera, background, image, length };
            image.draw(playable.base().info(), |camera, background| playable.render(camera, seconds, background))
        }
    })
}
