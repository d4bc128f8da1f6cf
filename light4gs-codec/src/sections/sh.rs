//! The spherical harmonics beyond degree 0.

use super::{SectionKind, check_length};
use crate::{
    CodecError, GaussianArrays, Limits, limits::at_most, reader::Reader, scene::sh_rest_coefficients, writer::Writer,
};

const SECTION: &str = SectionKind::Sh.name();

/// What stands before the numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    pub(crate) count: u32,
    pub(crate) degree: u8,
}

impl Head {
    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let head = Self { count: reader.u32("count")?, degree: reader.u8("degree")? };
        at_most(SECTION, "count", head.count.into(), limits.gaussians)?;
        head.check()?;
        Ok(head)
    }

    /// Refuses an unknown degree.
    pub(super) fn check(self) -> Result<(), CodecError> {
        check_degree(self.degree)
    }

    /// Numbers that follow.
    pub(super) fn values(self) -> u64 {
        u64::from(self.count) * sh_rest_coefficients(self.degree) as u64 * 3
    }
}

fn check_degree(degree: u8) -> Result<(), CodecError> {
    if degree <= 3 { Ok(()) } else { Err(CodecError::invalid(SECTION, "degree", degree, "0, 1, 2 or 3")) }
}

/// Refuses an unknown degree and an array of another length than the degree asks for.
pub(crate) fn check(gaussians: &GaussianArrays) -> Result<(), CodecError> {
    check_degree(gaussians.sh_degree)?;
    let (count, rest) = (gaussians.len(), sh_rest_coefficients(gaussians.sh_degree));
    let why = format!("{count} Gaussians, {rest} coefficients, 3 channels");
    check_length(SECTION, "sh_rest", gaussians.sh_rest.len(), count as u64 * rest as u64 * 3, &why)
}

pub(crate) fn write(gaussians: &GaussianArrays, writer: &mut Writer) {
    writer.u32(gaussians.len() as u32);
    writer.u8(gaussians.sh_degree);
    writer.f32s(&gaussians.sh_rest);
}

/// The head and the coefficients.
pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<(Head, Vec<f32>), CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader, limits)?;
    let values = reader.f32s("sh_rest", head.values())?;
    reader.finish()?;
    Ok((head, values))
}
