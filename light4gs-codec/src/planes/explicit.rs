//! Planes as float32.

use super::head::{Head, SECTION};
use crate::{
    CodecError, FeaturePlaneArrays,
    budget::Budget,
    bytes::{Reader, Writer},
};

/// Writes planes that [`super::head::check`] has accepted.
pub(crate) fn write(planes: &FeaturePlaneArrays, writer: &mut Writer) {
    Head::of_checked(planes).write(writer);
    planes.planes.iter().for_each(|plane| writer.f32s(&plane.values));
}

pub(crate) fn read(bytes: &[u8], budget: &Budget) -> Result<FeaturePlaneArrays, CodecError> {
    budget.things(SECTION, bytes.len() as u64, 1, 1)?;
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader, &budget.limits)?;
    let mut planes = FeaturePlaneArrays::without_values(head.channels, &head.layout);
    for (plane, shape) in planes.planes.iter_mut().zip(head.layout.planes()) {
        plane.values = reader.f32s(&format!("values of plane {}", shape.name()), head.values(shape.size))?;
    }
    reader.finish()?;
    Ok(planes)
}
