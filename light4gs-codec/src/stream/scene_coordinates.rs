//! The scene coordinates.

use crate::{
    CodecError, CoordinateMapping, SceneCoordinateArrays,
    bytes::{Reader, Section, Writer, sections::Kind},
};

/// The kind for scene coordinates: a mapping is written only where it differs from the paper's.
pub(crate) fn kind(coordinates: &SceneCoordinateArrays) -> Kind {
    match coordinates.mapping == CoordinateMapping::default() {
        true => Kind::SceneCoordinatesPrincipalAxes,
        false => Kind::SceneCoordinatesMapped,
    }
}

pub(crate) fn write(coordinates: &SceneCoordinateArrays, writer: &mut Writer) {
    writer.f32s(&coordinates.mean);
    writer.f32s(coordinates.axes.as_flattened());
    writer.f32s(&coordinates.std);
    if kind(coordinates) == Kind::SceneCoordinatesMapped {
        let CoordinateMapping { contracts, scale, offset, time_scale, time_offset } = coordinates.mapping;
        writer.u8(contracts.into());
        writer.f32s(&scale);
        writer.f32s(&offset);
        writer.f32s(&[time_scale, time_offset]);
    }
}

pub(crate) fn read(bytes: &[u8], kind: Kind) -> Result<SceneCoordinateArrays, CodecError> {
    const SECTION: &str = Section::SceneCoordinates.name();
    let mut reader = Reader::new(SECTION, bytes);
    let mut coordinates = SceneCoordinateArrays {
        mean: reader.group("mean")?,
        axes: [reader.group("axes")?, reader.group("axes")?, reader.group("axes")?],
        std: reader.group("std")?,
        mapping: CoordinateMapping::default(),
    };
    if kind == Kind::SceneCoordinatesMapped {
        let contracts = match reader.u8("contraction")? {
            0 => false,
            1 => true,
            other => return Err(CodecError::invalid(SECTION, "contraction", other, "0 or 1")),
        };
        let (scale, offset) = (reader.group("scale")?, reader.group("offset")?);
        let [time_scale, time_offset] = reader.group("time")?;
        coordinates.mapping = CoordinateMapping { contracts, scale, offset, time_scale, time_offset };
    }
    reader.finish()?;
    Ok(coordinates)
}
