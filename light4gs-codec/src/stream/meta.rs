//! The scene meta, which stands in the header.

use std::{collections::BTreeMap, f32::consts::PI};

use crate::{
    CodecError, Limits, SceneMeta,
    bytes::{
        Reader, Writer,
        names::{check_name, check_text},
    },
    fields,
    limits::at_most,
};

const SECTION: &str = "meta";

/// Refuses metadata that cannot be written or makes no sense.
pub(crate) fn check(meta: &SceneMeta, limits: &Limits) -> Result<(), CodecError> {
    check_name(SECTION, "name", &meta.name, limits)?;
    check_extra(&meta.extra, limits)?;
    at_most(SECTION, "frame_count", meta.frame_count.into(), limits.frames)?;
    limits.check_image(meta.width, meta.height)?;
    fields::check_finite_meta(meta)?;
    if meta.fov_x >= PI {
        return Err(CodecError::invalid(SECTION, "fov_x", meta.fov_x, "an angle below π"));
    }
    for (field, value) in [("fps", meta.fps), ("fov_x", meta.fov_x)] {
        if value < 0.0 {
            return Err(CodecError::invalid(SECTION, field, value, "0 (not known) or more"));
        }
    }
    let [low, high] = meta.bounds;
    for axis in 0..3 {
        if low[axis] > high[axis] {
            let found = format!("{low:?} to {high:?}");
            return Err(CodecError::invalid(SECTION, "bounds", found, "the smallest corner, then the largest"));
        }
    }
    Ok(())
}

/// Refuses extra entries that cannot be written.
pub(crate) fn check_extra(extra: &BTreeMap<String, String>, limits: &Limits) -> Result<(), CodecError> {
    at_most(SECTION, "number of extra entries", extra.len() as u64, limits.extras)?;
    for (key, value) in extra {
        check_name(SECTION, "extra key", key, limits)?;
        at_most(SECTION, format!("length of extra.{key}"), value.len() as u64, limits.string_bytes)?;
        check_text(SECTION, &format!("extra.{key}"), value, |c| c != '\n' && c != '\t')?;
    }
    Ok(())
}

pub(crate) fn write(meta: &SceneMeta, writer: &mut Writer) {
    writer.string(&meta.name);
    writer.u32(meta.frame_count);
    writer.f32(meta.fps);
    writer.f32s(meta.bounds.as_flattened());
    writer.f32s(&meta.background);
    writer.bytes.extend_from_slice(&meta.config_digest);
    writer.u32(meta.width);
    writer.u32(meta.height);
    writer.f32(meta.fov_x);
    write_extra(&meta.extra, writer);
}

/// Their number, then each key and its value.
pub(crate) fn write_extra(extra: &BTreeMap<String, String>, writer: &mut Writer) {
    writer.u32(extra.len() as u32);
    for (key, value) in extra {
        writer.string(key);
        writer.string(value);
    }
}

pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<SceneMeta, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let meta = SceneMeta {
        name: reader.string("name", limits.string_bytes)?,
        frame_count: reader.u32("frame_count")?,
        fps: reader.f32("fps")?,
        bounds: [reader.group("bounds")?, reader.group("bounds")?],
        background: reader.group("background")?,
        config_digest: reader.array("config_digest")?,
        width: reader.u32("width")?,
        height: reader.u32("height")?,
        fov_x: reader.f32("fov_x")?,
        extra: read_extra(&mut reader, limits)?,
    };
    reader.finish()?;
    Ok(meta)
}

/// Keys are strictly ascending, so that each meta has only one encoding.
pub(crate) fn read_extra(reader: &mut Reader<'_>, limits: &Limits) -> Result<BTreeMap<String, String>, CodecError> {
    let count = reader.u32("number of extra entries")?;
    at_most(SECTION, "number of extra entries", count.into(), limits.extras)?;
    let mut extra = BTreeMap::new();
    for _ in 0..count {
        let key = reader.string("extra key", limits.string_bytes)?;
        let value = reader.string("extra value", limits.string_bytes)?;
        if let Some((last, _)) = extra.last_key_value()
            && *last >= key
        {
            return Err(CodecError::invalid(SECTION, "extra", format!("{key:?} after {last:?}"), "rising keys"));
        }
        extra.insert(key, value);
    }
    Ok(extra)
}
