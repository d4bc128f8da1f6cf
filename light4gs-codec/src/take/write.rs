//! Writing a whole take.

use super::{
    NewSegment, SECTION, TakeMeta,
    index::{check_still, of_base},
    new_segment::check_times,
    prelude, row,
};
use crate::{CodecError, Limits, info_with_limits, limits::at_most};

/// A take of these segments, in their order in the file. Its index has `spare_slots` slots for more of them.
///
/// `base` is a `.l4gs` stream of a still scene; it may have no Gaussians.
///
/// # Errors
/// A base that moves; streams that are damaged; times that are not in order, or overlap; a hidden list with another number of
/// Gaussians than the base has; metadata that cannot be written; more than [`Limits::large`] accepts. The message names the part
/// and the field.
pub fn write_take(
    meta: &TakeMeta,
    base: &[u8],
    segments: &[NewSegment],
    spare_slots: u32,
) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::large();
    let capacity = (segments.len() as u64).saturating_add(spare_slots.into());
    at_most(SECTION, "slots of the index", capacity, limits.segments)?;
    let of_stream = info_with_limits(base, &limits).map_err(of_base)?;
    check_still(&of_stream)?;
    let meta = meta.write(&limits)?;
    // At most the limit of segments.
    let capacity = capacity as u32;
    let (mut bytes, base_offset) = prelude::write(&meta, capacity, base.len() as u64, of_stream.gaussian_count);

    let mut offset = base_offset + base.len() as u64;
    let (mut places, mut parts) = (Vec::new(), Vec::new());
    for (number, segment) in segments.iter().enumerate() {
        let (place, part) = segment.write(number, offset, of_stream.gaussian_count, &limits)?;
        offset += place.bytes;
        places.push(place);
        parts.push(part);
    }
    check_times(places.iter().copied())?;

    // The first row is the link, of which there is none yet.
    bytes.resize(bytes.len() + row::BYTES as usize, 0);
    places.iter().for_each(|place| bytes.extend(place.write()));
    bytes.resize(base_offset as usize, 0);
    bytes.extend_from_slice(base);
    parts.iter().for_each(|part| bytes.extend_from_slice(part));
    Ok(bytes)
}
