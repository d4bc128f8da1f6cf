//! The attributes of Gaussians, except the spherical harmonics beyond degree 0 (docs/design.md).
//!
//! A section is a list of named attributes, each with its width and its coder; `docs/format.md` has the bytes. In the
//! profile without loss all are float32. In the compact one, positions are rounded to a grid and sorted in Morton
//! order, and coded as a set (`positions.rs`). The other attributes follow in that order, uniformly quantized: each
//! channel is predicted linearly from the nearest Gaussians before and from the channels before, and the residual is
//! coded adaptively. A further attribute without a step stays float32.
//!
//! ```
//! use light4gs_codec::{FurtherAttribute, GaussianArrays, Limits, attributes::{self, AttributeSteps}};
//!
//! let age = FurtherAttribute { name: "age".into(), width: 1, values: vec![7.0, 8.0], optional: true };
//! let gaussians = GaussianArrays {
//!     means: vec![[0.5, 0.0, 0.0], [0.0; 3]],
//!     log_scales: vec![[-3.0; 3]; 2],
//!     quats: vec![[1.0, 0.0, 0.0, 0.0]; 2],
//!     opacity_logits: vec![2.0, -1.0],
//!     sh_dc: vec![[0.1; 3]; 2],
//!     further: vec![age],
//!     ..Default::default()
//! };
//! let steps = AttributeSteps::default().with("age", 0.5);
//! let encoded = attributes::encode(&gaussians, &steps)?;
//! let decoded = attributes::decode(&encoded.bytes, &Limits::default())?;
//! assert_eq!(decoded, attributes::quantized(&gaussians, &steps)?);
//! // Other arrays must follow the Gaussians: the first of the new order was the second.
//! assert_eq!(encoded.order, [1, 0]);
//! assert_eq!(decoded.further[0].values, [8.0, 7.0]);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```

pub(crate) mod channels;
mod least_squares;
mod neighbors;
mod order;
mod position_grid;
mod positions;
mod prediction;
mod quantized;
mod section;
mod steps;

pub use least_squares::least_squares;
pub use neighbors::NEIGHBORS;
pub(crate) use neighbors::all_nearest_before;
pub use order::CodingOrder;
pub(crate) use position_grid::check_positions;
use position_grid::{PositionGrid, cell_point, morton_cell};
pub use quantized::typical_size;
use quantized::{Quantized, join};
pub use section::AttributeInfo;
pub(crate) use section::{Head, check};
pub use steps::AttributeSteps;
use steps::check_step;

use crate::{
    AttributeValues, CodecError, Coder, FurtherAttribute, GaussianArrays, Limits,
    adaptive::{BitDecoder, BitEncoder, LARGEST_INDEX},
    budget::Budget,
    bytes::{Reader, Section, Writer, sections::Encoding},
    scene::{BUILT_IN, SH_REST},
};

const SECTION: &str = Section::Gaussians.name();
/// The most Gaussians for each byte of a section: a count is checked against it before memory is taken.
const GAUSSIANS_A_BYTE: usize = 8;

/// Bytes that decoding takes for a Gaussian: 56 that stay, neighbors, and the integers of the largest attribute.
const GAUSSIAN_BYTES: u64 = 136;
/// Nanoseconds to find a Gaussian's neighbors and to read its built-in attributes, however few bits these take.
const GAUSSIAN_NANOSECONDS: u64 = 3000;
/// Nanoseconds of a level of the tree of positions.
const LEVEL_NANOSECONDS: u64 = 12;
/// Bytes that decoding takes for a quantized number of a further attribute: the number, its integer, and its share of
/// the prediction.
const NUMBER_BYTES: u64 = 28;
/// Nanoseconds to read such a number, however few bits it takes.
const NUMBER_NANOSECONDS: u64 = 300;

/// Coded attributes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodedAttributes {
    /// What [`decode`] reads.
    pub bytes: Vec<u8>,
    /// `order[new]` is the index in the given arrays of the Gaussian `new` of the decoded ones. Everything else that
    /// belongs to a Gaussian, such as the higher spherical harmonics, must be reordered in the same way.
    pub order: Vec<u32>,
    /// The attributes with their bytes, in the order of the stream.
    pub attributes: Vec<AttributeInfo>,
}

impl EncodedAttributes {
    /// Bytes of the list of attributes, and of the zeros at the end where there are any.
    pub fn overhead(&self) -> usize {
        self.bytes.len() - self.attributes.iter().map(|attribute| attribute.bytes as usize).sum::<usize>()
    }
}

/// Codes `N` Gaussians, quantized, without `sh_degree` and `sh_rest`.
///
/// # Errors
/// Arrays of different lengths, NaN and infinities, names that no attribute can have, steps that are not positive, positions
/// beyond ±1e30, and other numbers beyond 2^23 steps.
pub fn encode(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<EncodedAttributes, CodecError> {
    Ok(encode_quantized(Quantized::of(gaussians, steps)?))
}

/// Codes layers of Gaussians, given by their indices: each can be decoded by itself, and all of them have one grid and one
/// set of steps, so that a Gaussian has the same bits in whatever layer it is. Returns the decoded Gaussians of each layer too.
pub(crate) fn encode_layers(
    gaussians: &GaussianArrays,
    steps: &AttributeSteps,
    layers: &[Vec<u32>],
) -> Result<Vec<(EncodedAttributes, GaussianArrays)>, CodecError> {
    let all = Quantized::of(gaussians, steps)?;
    let code = |layer: Quantized| {
        let decoded = layer.reconstructed();
        (encode_quantized(layer), decoded)
    };
    Ok(all.into_layers(layers).into_iter().map(code).collect())
}

fn encode_quantized(quantized: Quantized) -> EncodedAttributes {
    let neighbors = quantized.neighbors();
    let mut streams: Vec<Vec<u8>> = Vec::new();
    let mut attributes: Vec<AttributeInfo> = Vec::new();
    for attribute in &quantized.attributes {
        let mut writer = Writer::default();
        attribute.write(&quantized, &neighbors, &mut writer);
        attributes.push(attribute.info(writer.bytes.len()));
        streams.push(writer.bytes);
    }

    let mut writer = Writer::default();
    let head = Head { count: quantized.order.len() as u32, attributes };
    head.write(&mut writer);
    streams.iter().for_each(|stream| writer.bytes.extend(stream));
    let least = quantized.order.len().div_ceil(GAUSSIANS_A_BYTE);
    writer.bytes.resize(writer.bytes.len().max(least), 0);
    EncodedAttributes { bytes: writer.bytes, order: quantized.order, attributes: head.attributes }
}

/// Writes Gaussians whose arrays fit together as float32, without `sh_degree` and `sh_rest`. Returns the list of attributes.
pub(crate) fn write_float32(gaussians: &GaussianArrays, writer: &mut Writer) -> Vec<AttributeInfo> {
    let attributes = || gaussians.attributes().filter(|attribute| attribute.name != SH_REST);
    let info = |attribute: AttributeValues<'_>| AttributeInfo {
        name: attribute.name.to_owned(),
        width: attribute.width as u32,
        coder: Coder::Float32,
        optional: attribute.optional,
        bytes: 4 * attribute.values.len() as u64,
    };
    let head = Head { count: gaussians.len() as u32, attributes: attributes().map(info).collect() };
    head.write(writer);
    attributes().for_each(|attribute| writer.f32s(attribute.values));
    head.attributes
}

/// Reads what [`encode`] writes: Gaussians in Morton order; `sh_degree` is 0 and `sh_rest` empty. Attributes with an
/// unknown coder are skipped if they are optional.
///
/// # Errors
/// Bytes that [`encode`] does not write, and more Gaussians than the limits allow. Memory is taken for at most eight
/// Gaussians a byte.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<GaussianArrays, CodecError> {
    decode_within(bytes, Encoding::Quantized, &Budget::new(limits))
}

/// As [`decode`], for either encoding, within a budget.
pub(crate) fn decode_within(bytes: &[u8], encoding: Encoding, budget: &Budget) -> Result<GaussianArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader, encoding, &budget.limits)?;
    let gaussians = match encoding {
        Encoding::Float32 => {
            budget.things(SECTION, bytes.len() as u64, 1, 1)?;
            let mut numbers = Numbers::default();
            for attribute in &head.attributes {
                numbers.add(attribute, read_float32(&mut reader, attribute)?);
            }
            numbers.into_gaussians()
        }
        Encoding::Quantized => read_quantized(&mut reader, &head, bytes.len(), budget)?,
    };
    let padded = encoding == Encoding::Quantized && bytes.len() == (head.count as usize).div_ceil(GAUSSIANS_A_BYTE);
    finish(reader, padded)?;
    Ok(gaussians)
}

/// Reads the numbers of a quantized section of `all` bytes.
fn read_quantized(
    reader: &mut Reader<'_>,
    head: &Head,
    all: usize,
    budget: &Budget,
) -> Result<GaussianArrays, CodecError> {
    let count = head.count as usize;
    if all < count.div_ceil(GAUSSIANS_A_BYTE) {
        let expected = format!("at most {GAUSSIANS_A_BYTE} a byte, of which there are {all}");
        return Err(CodecError::invalid(SECTION, "count", count, expected));
    }
    budget.stream(SECTION, all)?;
    let (positions, others) = head.attributes.split_first().expect("`Head::read` refuses a head without positions");
    let mut stream = take_stream(reader, positions)?;
    let grid = PositionGrid::read(&mut stream)?;
    let nanoseconds = GAUSSIAN_NANOSECONDS + LEVEL_NANOSECONDS * u64::from(grid.code_bits());
    budget.things(SECTION, count as u64, GAUSSIAN_BYTES, nanoseconds)?;
    for further in &others[BUILT_IN.len() - 1..] {
        let (bytes, nanoseconds) = match further.coder {
            Coder::Float32 => (4, 4),
            Coder::Unknown(_) => (0, 0),
            _ => (NUMBER_BYTES, NUMBER_NANOSECONDS),
        };
        budget.things(SECTION, (count as u64).saturating_mul(further.width.into()), bytes, nanoseconds)?;
    }

    let mut codes = vec![0; count];
    positions::code(&mut BitDecoder::new(stream.rest()), &mut codes, grid.code_bits())
        .map_err(|_| damaged(&positions.name))?;
    let cells: Vec<_> = codes.iter().map(|&code| morton_cell(code)).collect();
    drop(codes);
    let mut numbers = Numbers::default();
    numbers.add(positions, cells.iter().flat_map(|&cell| grid.mean(cell)).collect());
    let points: Vec<_> = cells.into_iter().map(cell_point).collect();
    let neighbors = all_nearest_before(&points);
    drop(points);

    // The integers of one attribute are freed before those of the next are read.
    for attribute in others {
        match attribute.coder {
            Coder::Float32 => numbers.add(attribute, read_float32(reader, attribute)?),
            Coder::Unknown(_) => {
                let _ = take_stream(reader, attribute)?;
            }
            _ => {
                let mut stream = take_stream(reader, attribute)?;
                let step = stream.f32(&format!("step of {}", attribute.name))?;
                check_step(&attribute.name, step)?;
                numbers.add(attribute, join(&read_channels(stream, attribute, &neighbors)?, step, attribute.coder));
            }
        }
    }
    Ok(numbers.into_gaussians())
}

/// What [`decode`] returns for what [`encode`] writes: the quantized Gaussians in their new order.
///
/// # Errors
/// As [`encode`].
pub fn quantized(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<GaussianArrays, CodecError> {
    Ok(Quantized::of(gaussians, steps)?.reconstructed())
}

/// Asks for what reading `numbers` of quantized channels of `count` Gaussians takes, neighbors included.
pub(crate) fn ask_for_channels(
    section: &'static str,
    count: u64,
    numbers: u64,
    budget: &Budget,
) -> Result<(), CodecError> {
    budget.things(section, count, GAUSSIAN_BYTES, GAUSSIAN_NANOSECONDS)?;
    budget.things(section, numbers, NUMBER_BYTES, NUMBER_NANOSECONDS)
}

/// The bytes of an attribute.
fn take_stream<'a>(reader: &mut Reader<'a>, attribute: &AttributeInfo) -> Result<Reader<'a>, CodecError> {
    Ok(Reader::new(SECTION, reader.take(&attribute.name, attribute.bytes)?))
}

fn read_float32(reader: &mut Reader<'_>, attribute: &AttributeInfo) -> Result<Vec<f32>, CodecError> {
    reader.f32s(&attribute.name, attribute.bytes / 4)
}

/// Reads an attribute, refusing numbers that could not be reconstructed.
fn read_channels(
    stream: Reader<'_>,
    attribute: &AttributeInfo,
    neighbors: &[[u32; NEIGHBORS]],
) -> Result<Vec<Vec<i32>>, CodecError> {
    let AttributeInfo { name, width, .. } = attribute;
    let channels = channels::decode(stream.rest(), *width as usize, neighbors).map_err(|_| damaged(name))?;
    match channels.iter().flatten().find(|index| index.unsigned_abs() > LARGEST_INDEX.unsigned_abs()) {
        None => Ok(channels),
        Some(index) => {
            let expected = format!("at most {LARGEST_INDEX} steps from 0");
            Err(CodecError::invalid(SECTION, name, format!("{index} steps"), expected))
        }
    }
}

/// Refuses anything after the attributes; in a padded section, anything but zeros.
fn finish(mut reader: Reader<'_>, padded: bool) -> Result<(), CodecError> {
    while padded && reader.demand("zeros", 1).is_ok() {
        if reader.u8("zeros")? != 0 {
            return Err(CodecError::invalid(SECTION, "zeros at the end", "something else", "zeros"));
        }
    }
    reader.finish()
}

fn damaged(field: &str) -> CodecError {
    CodecError::invalid(SECTION, field, "damaged or cut short", "a range-coded stream")
}

/// Attributes as they are read from a section.
#[derive(Default)]
struct Numbers {
    /// Those of all scenes, in the order of [`BUILT_IN`].
    built_in: Vec<Vec<f32>>,
    further: Vec<FurtherAttribute>,
}

impl Numbers {
    /// Adds the next one; the built-in ones come first.
    fn add(&mut self, attribute: &AttributeInfo, values: Vec<f32>) {
        if self.built_in.len() < BUILT_IN.len() {
            self.built_in.push(values);
            return;
        }
        let AttributeInfo { name, width, optional, .. } = attribute;
        self.further.push(FurtherAttribute { name: name.clone(), width: *width, values, optional: *optional });
    }

    fn into_gaussians(self) -> GaussianArrays {
        fn rows<const K: usize>(values: Vec<f32>) -> Vec<[f32; K]> {
            values.as_chunks().0.to_vec()
        }
        let Ok([means, log_scales, quats, opacity_logits, sh_dc]) =
            <[Vec<f32>; BUILT_IN.len()]>::try_from(self.built_in)
        else {
            unreachable!("a head has all built-in attributes");
        };
        GaussianArrays {
            means: rows(means),
            log_scales: rows(log_scales),
            quats: rows(quats),
            opacity_logits,
            sh_dc: rows(sh_dc),
            further: self.further,
            ..GaussianArrays::default()
        }
    }
}
