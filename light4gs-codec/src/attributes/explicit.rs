//! Attributes as plain numbers.

use super::SECTION;
use crate::{
    CodecError, GaussianArrays, Limits,
    budget::Budget,
    bytes::{Reader, Writer, check_length},
    limits::at_most,
};

/// What stands before the numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    pub(crate) count: u32,
}

impl Head {
    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let head = Self { count: reader.u32("count")? };
        at_most(SECTION, "count", head.count.into(), limits.gaussians)?;
        Ok(head)
    }
}

/// Refuses arrays of different lengths.
pub(crate) fn check(gaussians: &GaussianArrays, limits: &Limits) -> Result<(), CodecError> {
    let count = gaussians.len() as u64;
    at_most(SECTION, "count", count, limits.gaussians)?;
    let why = "one for each of the means";
    check_length(SECTION, "log_scales", gaussians.log_scales.len(), count, why)?;
    check_length(SECTION, "quats", gaussians.quats.len(), count, why)?;
    check_length(SECTION, "opacity_logits", gaussians.opacity_logits.len(), count, why)?;
    check_length(SECTION, "sh_dc", gaussians.sh_dc.len(), count, why)
}

pub(crate) fn write(gaussians: &GaussianArrays, writer: &mut Writer) {
    writer.u32(gaussians.len() as u32);
    writer.f32s(gaussians.means.as_flattened());
    writer.f32s(gaussians.log_scales.as_flattened());
    writer.f32s(gaussians.quats.as_flattened());
    writer.f32s(&gaussians.opacity_logits);
    writer.f32s(gaussians.sh_dc.as_flattened());
}

/// Everything but `sh_degree` and `sh_rest`, which are left empty.
pub(crate) fn read(bytes: &[u8], budget: &Budget) -> Result<GaussianArrays, CodecError> {
    budget.things(SECTION, bytes.len() as u64, 1, 1)?;
    let mut reader = Reader::new(SECTION, bytes);
    let count = Head::read(&mut reader, &budget.limits)?.count.into();
    let gaussians = GaussianArrays {
        means: reader.groups("means", count)?,
        log_scales: reader.groups("log_scales", count)?,
        quats: reader.groups("quats", count)?,
        opacity_logits: reader.f32s("opacity_logits", count)?,
        sh_dc: reader.groups("sh_dc", count)?,
        ..GaussianArrays::default()
    };
    reader.finish()?;
    Ok(gaussians)
}
