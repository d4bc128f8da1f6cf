//! Planes as plain numbers.

use super::head::{Head, SECTION};
use crate::{
    CodecError, HexPlaneArrays, Plane,
    budget::Budget,
    bytes::{Reader, Writer},
};

/// Writes planes that [`super::head::check`] has passed.
pub(crate) fn write(hexplane: &HexPlaneArrays, writer: &mut Writer) {
    Head::write(hexplane, writer);
    hexplane.planes.iter().for_each(|plane| writer.f32s(&plane.values));
}

pub(crate) fn read(bytes: &[u8], budget: &Budget) -> Result<HexPlaneArrays, CodecError> {
    budget.things(SECTION, bytes.len() as u64, 1, 1)?;
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader, &budget.limits)?;
    let mut planes = Vec::with_capacity(head.sizes.len());
    for (index, &[height, width]) in head.sizes.iter().enumerate() {
        let values = reader.f32s(&format!("planes[{index}].values"), head.values([height, width]))?;
        planes.push(Plane { height, width, values });
    }
    reader.finish()?;
    let Head { channels, resolution, multipliers, .. } = head;
    Ok(HexPlaneArrays { channels, resolution, multipliers, planes })
}
