//! The frame that normalizes positions.

use crate::{
    CodecError, CoordinateMapping, SceneFrameArrays,
    bytes::{Reader, Section, Writer, sections::Kind},
};

/// The kind that holds a frame: the mapping is written only where it is not the paper's.
pub(crate) fn kind(frame: &SceneFrameArrays) -> Kind {
    match frame.mapping == CoordinateMapping::default() {
        true => Kind::SceneFramePrincipalAxes,
        false => Kind::SceneFrameMapped,
    }
}

pub(crate) fn write(frame: &SceneFrameArrays, writer: &mut Writer) {
    writer.f32s(&frame.mean);
    writer.f32s(frame.axes.as_flattened());
    writer.f32s(&frame.std);
    if kind(frame) == Kind::SceneFrameMapped {
        let CoordinateMapping { contracts, scale, offset, time_scale, time_offset } = frame.mapping;
        writer.u8(contracts.into());
        writer.f32s(&scale);
        writer.f32s(&offset);
        writer.f32s(&[time_scale, time_offset]);
    }
}

pub(crate) fn read(bytes: &[u8], kind: Kind) -> Result<SceneFrameArrays, CodecError> {
    const SECTION: &str = Section::SceneFrame.name();
    let mut reader = Reader::new(SECTION, bytes);
    let mut frame = SceneFrameArrays {
        mean: reader.group("mean")?,
        axes: [reader.group("axes")?, reader.group("axes")?, reader.group("axes")?],
        std: reader.group("std")?,
        mapping: CoordinateMapping::default(),
    };
    if kind == Kind::SceneFrameMapped {
        let contracts = match reader.u8("contraction")? {
            0 => false,
            1 => true,
            other => return Err(CodecError::invalid(SECTION, "contraction", other, "0 or 1")),
        };
        let (scale, offset) = (reader.group("scale")?, reader.group("offset")?);
        let [time_scale, time_offset] = reader.group("time")?;
        frame.mapping = CoordinateMapping { contracts, scale, offset, time_scale, time_offset };
    }
    reader.finish()?;
    Ok(frame)
}
