//! What is said of the whole take.

use std::collections::BTreeMap;

use super::times::LONGEST;
use crate::{
    CodecError, Limits,
    bytes::{Reader, Writer, names::check_name},
    limits::at_most,
    stream::meta::{check_extra, read_extra, write_extra},
};

const SECTION: &str = "meta of the take";

/// What is said of the whole take. What is said of a scene stands in the meta of each stream.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TakeMeta {
    /// Name of the take.
    pub name: String,
    /// Frames a second, 0 where not known.
    pub fps: f32,
    /// Seconds of the whole take, which need not have segments everywhere; 0 where not known.
    pub seconds: f64,
    /// Further facts. Keys are names; values may have line feeds and tabs.
    pub extra: BTreeMap<String, String>,
}

impl TakeMeta {
    /// Refuses what cannot be written or makes no sense.
    pub(super) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        check_name(SECTION, "name", &self.name, limits)?;
        if !(self.fps.is_finite() && self.fps >= 0.0) {
            return Err(CodecError::invalid(SECTION, "fps", self.fps, "a finite number, 0 (not known) or more"));
        }
        if !(0.0..=LONGEST).contains(&self.seconds) {
            let expected = format!("a number from 0 (not known) to {LONGEST:e}");
            return Err(CodecError::invalid(SECTION, "seconds", self.seconds, expected));
        }
        check_extra(&self.extra, limits)
    }

    /// Its bytes.
    pub(super) fn write(&self, limits: &Limits) -> Result<Vec<u8>, CodecError> {
        self.check(limits)?;
        let mut writer = Writer::default();
        writer.string(&self.name);
        writer.f32(self.fps);
        writer.f64(self.seconds);
        write_extra(&self.extra, &mut writer);
        at_most(SECTION, "length", writer.bytes.len() as u64, limits.meta_bytes)?;
        Ok(writer.bytes)
    }

    pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        let mut reader = Reader::new(SECTION, bytes);
        let meta = Self {
            name: reader.string("name", limits.string_bytes)?,
            fps: reader.f32("fps")?,
            seconds: reader.f64("seconds")?,
            extra: read_extra(&mut reader, limits)?,
        };
        reader.finish()?;
        meta.check(limits)?;
        Ok(meta)
    }
}
