//! The head of the section: which attributes there are, how wide they are, and how they are stored.

use super::SECTION;
use crate::{
    CodecError, Coder, GaussianArrays, Limits,
    bytes::{Reader, Writer, check_length, sections::Encoding},
    limits::at_most,
    scene::{BUILT_IN, LONGEST_ATTRIBUTE_NAME, is_built_in, legal_attribute_name},
};

/// Set in the byte of a coder where a reader that does not know the attribute may leave it out.
const OPTIONAL: u8 = 0x80;

/// One attribute as a stream describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttributeInfo {
    /// Its name.
    pub name: String,
    /// Numbers a Gaussian.
    pub width: u32,
    /// How they are stored.
    pub coder: Coder,
    /// Whether the scene looks right without it.
    pub optional: bool,
    /// Bytes of its numbers, steps included.
    pub bytes: u64,
}

/// The beginning of the section.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) count: u32,
    pub(crate) attributes: Vec<AttributeInfo>,
}

impl Coder {
    /// The coders that have a number in the stream, in the order of these numbers.
    const ALL: [Self; 4] = [Self::Float32, Self::Grid, Self::Channels, Self::Colors];

    fn number(self) -> u8 {
        match self {
            Self::Float32 => 0,
            Self::Grid => 1,
            Self::Channels => 2,
            Self::Colors => 3,
            Self::Unknown(number) => number,
        }
    }

    fn from_number(number: u8) -> Self {
        Self::ALL.get(usize::from(number)).copied().unwrap_or(Self::Unknown(number))
    }

    /// A name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Float32 => "float32",
            Self::Grid => "grid",
            Self::Channels => "channels",
            Self::Colors => "colors",
            Self::Unknown(_) => "unknown",
        }
    }
}

impl Head {
    pub(crate) fn write(&self, writer: &mut Writer) {
        writer.u32(self.count);
        writer.varint(self.attributes.len() as u64);
        for AttributeInfo { name, width, coder, optional, bytes } in &self.attributes {
            writer.block(name.as_bytes());
            writer.varint((*width).into());
            writer.u8(coder.number() | if *optional { OPTIONAL } else { 0 });
            if *coder != Coder::Float32 {
                writer.varint(*bytes);
            }
        }
    }

    /// Reads and checks it. The numbers of the attributes follow, in the same order.
    pub(crate) fn read(reader: &mut Reader<'_>, encoding: Encoding, limits: &Limits) -> Result<Self, CodecError> {
        let count = reader.u32("count")?;
        at_most(SECTION, "count", count.into(), limits.gaussians)?;
        let number = reader.varint_at_most("number of attributes", limits.attributes)?;
        let mut attributes: Vec<AttributeInfo> = Vec::new();
        for index in 0..number as usize {
            let length = reader.varint_at_most("length of an attribute's name", LONGEST_ATTRIBUTE_NAME as u32)?;
            let name = reader.take("an attribute's name", length.into())?;
            check_name(index, name, &attributes)?;
            // `check_name` accepts ASCII only.
            let name = String::from_utf8_lossy(name).into_owned();
            let width = reader.varint_at_most(&format!("width of {name}"), limits.attribute_width)?;
            let byte = reader.u8(&format!("coder of {name}"))?;
            let (coder, optional) = (Coder::from_number(byte & !OPTIONAL), byte & OPTIONAL != 0);
            let bytes = match coder {
                Coder::Float32 => (4 * u64::from(count)).saturating_mul(width.into()),
                _ => reader.varint(&format!("length of {name}"))?,
            };
            let attribute = AttributeInfo { name, width, coder, optional, bytes };
            check_attribute(index, &attribute, encoding)?;
            attributes.push(attribute);
        }
        match BUILT_IN.get(attributes.len()) {
            Some(missing) => Err(order(missing.name, "missing")),
            None => Ok(Self { count, attributes }),
        }
    }
}

fn order(expected: &str, found: impl ToString) -> CodecError {
    let names = BUILT_IN.map(|row| row.name).join(", ");
    CodecError::invalid(SECTION, format!("attribute {expected}"), found, format!("{names}, then further attributes"))
}

/// Refuses names that are out of order, occur twice, or have other letters than those allowed.
fn check_name(index: usize, name: &[u8], before: &[AttributeInfo]) -> Result<(), CodecError> {
    if let Some(row) = BUILT_IN.get(index) {
        return if name == row.name.as_bytes() { Ok(()) } else { Err(order(row.name, format!("{:?}", shown(name)))) };
    }
    let twice = before.iter().any(|attribute| attribute.name.as_bytes() == name);
    match std::str::from_utf8(name) {
        Ok(name) if legal_attribute_name(name) && !twice => Ok(()),
        _ => Err(illegal_name(&shown(name), twice)),
    }
}

fn shown(name: &[u8]) -> String {
    name.escape_ascii().to_string()
}

fn illegal_name(name: &str, twice: bool) -> CodecError {
    let reserved = is_built_in(name);
    let found = format!("{name:?}{}", if twice || reserved { " twice" } else { "" });
    let expected = format!("1 to {LONGEST_ATTRIBUTE_NAME} of a-z, 0-9, '-', '_', each name once");
    CodecError::invalid(SECTION, "name of an attribute", found, expected)
}

/// Refuses widths and coders that an attribute cannot have.
fn check_attribute(index: usize, attribute: &AttributeInfo, encoding: Encoding) -> Result<(), CodecError> {
    let AttributeInfo { name, width, coder, optional, .. } = attribute;
    let built_in = BUILT_IN.get(index);
    let expected = built_in.map_or(1..=u32::MAX, |row| row.width as u32..=row.width as u32);
    if !expected.contains(width) {
        let expected = built_in.map_or("1 or more".to_owned(), |row| row.width.to_string());
        return Err(CodecError::invalid(SECTION, format!("width of {name}"), width, expected));
    }
    if built_in.is_some() && *optional {
        let expected = "no mark, since every scene needs it";
        return Err(CodecError::invalid(SECTION, format!("mark of {name}"), "may be left out", expected));
    }
    let coder_is = |expected: &str| {
        let found = format!("{} ({})", coder.number(), coder.name());
        Err(CodecError::invalid(SECTION, format!("coder of {name}"), found, expected))
    };
    match coder {
        Coder::Float32 if index > 0 || encoding == Encoding::Float32 => Ok(()),
        _ if encoding == Encoding::Float32 => coder_is("0 (float32), the encoding of the section"),
        Coder::Grid if index == 0 => Ok(()),
        _ if index == 0 => coder_is("1 (grid), which gives the order of the Gaussians"),
        Coder::Channels => Ok(()),
        Coder::Colors if *width == 3 => Ok(()),
        // Its length is known, so it can be left out.
        Coder::Unknown(_) if *optional => Ok(()),
        Coder::Unknown(_) => coder_is("one that this program knows; use a newer program"),
        _ => coder_is("0 (float32), 2 (channels), or 3 (colors) for a width of 3"),
    }
}

/// Refuses arrays of different lengths, and further attributes that no stream can hold.
pub(crate) fn check(gaussians: &GaussianArrays, limits: &Limits) -> Result<(), CodecError> {
    let count = gaussians.len() as u64;
    at_most(SECTION, "count", count, limits.gaussians)?;
    at_most(SECTION, "number of attributes", (BUILT_IN.len() + gaussians.further.len()) as u64, limits.attributes)?;
    for (index, attribute) in gaussians.further.iter().enumerate() {
        let twice = gaussians.further[..index].iter().any(|other| other.name == attribute.name);
        if twice || !legal_attribute_name(&attribute.name) {
            let start: String = attribute.name.chars().take(LONGEST_ATTRIBUTE_NAME).collect();
            return Err(illegal_name(&start, twice));
        }
        at_most(SECTION, format!("width of {}", attribute.name), attribute.width.into(), limits.attribute_width)?;
        if attribute.width == 0 {
            return Err(CodecError::invalid(SECTION, format!("width of {}", attribute.name), 0, "1 or more"));
        }
    }
    for attribute in gaussians.attributes().filter(|attribute| attribute.name != crate::scene::SH_REST) {
        let (width, found) = (attribute.width, attribute.values.len());
        if !found.is_multiple_of(width) {
            let expected = format!("{} (width {width} for each of the means)", count * width as u64);
            return Err(CodecError::invalid(SECTION, format!("length of {}", attribute.name), found, expected));
        }
        check_length(SECTION, attribute.name, found / width, count, "one for each of the means")?;
    }
    Ok(())
}
