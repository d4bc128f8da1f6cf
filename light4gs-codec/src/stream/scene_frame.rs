//! The frame that normalizes positions.

use super::{reader::Reader, sections::Section, writer::Writer};
use crate::{CodecError, SceneFrameArrays};

pub(crate) fn write(frame: &SceneFrameArrays, writer: &mut Writer) {
    writer.f32s(&frame.mean);
    writer.f32s(frame.axes.as_flattened());
    writer.f32s(&frame.std);
}

pub(crate) fn read(bytes: &[u8]) -> Result<SceneFrameArrays, CodecError> {
    let mut reader = Reader::new(Section::SceneFrame.name(), bytes);
    let frame = SceneFrameArrays {
        mean: reader.group("mean")?,
        axes: [reader.group("axes")?, reader.group("axes")?, reader.group("axes")?],
        std: reader.group("std")?,
    };
    reader.finish()?;
    Ok(frame)
}
