//! Compact coding of the Gaussians' attributes, but for the higher spherical harmonics (docs/design.md).
//!
//! Positions go onto a grid and into Morton order, in which they are coded as a set (`positions.rs`). The other
//! attributes follow in that order, uniformly quantized. Each channel is predicted linearly from the nearest Gaussians
//! before and from the channels before, and what the prediction misses by is coded adaptively.
//!
//! ```
//! use light4gs_codec::{GaussianArrays, Limits, attributes::{self, AttributeSteps}};
//!
//! let gaussians = GaussianArrays {
//!     means: vec![[0.5, 0.0, 0.0], [0.0; 3]],
//!     log_scales: vec![[-3.0; 3]; 2],
//!     quats: vec![[1.0, 0.0, 0.0, 0.0]; 2],
//!     opacity_logits: vec![2.0, -1.0],
//!     sh_dc: vec![[0.1; 3]; 2],
//!     ..Default::default()
//! };
//! let steps = AttributeSteps::default();
//! let encoded = attributes::encode(&gaussians, &steps)?;
//! let decoded = attributes::decode(&encoded.bytes, &Limits::default())?;
//! assert_eq!(decoded, attributes::quantized(&gaussians, &steps)?);
//! // Other arrays must follow the Gaussians: the first of the new order was the second.
//! assert_eq!(encoded.order, [1, 0]);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! The bytes, all numbers little-endian:
//!
//! | type | field |
//! |---|---|
//! | `u32` | number of Gaussians `N` |
//! | 3 × `f32`, `f32`, `u8` | grid: smallest corner, step, bits of a coordinate (at most 20) |
//! | 4 × `f32` | steps of log scales, opacity logits, quaternions, spherical harmonics of degree 0 |
//! | 5 × `u32` | lengths of the streams that follow |
//! | bytes | range-coded streams: positions and the four attributes in the order of the steps |
//! | zeros | as many as make `N / 8` bytes of all, so that a count can be trusted |

mod channels;
pub(crate) mod explicit;
mod neighbors;
mod position_grid;
mod positions;
mod prediction;
mod steps;

use neighbors::{NEIGHBORS, nearest_before};
pub(crate) use position_grid::check_positions;
use position_grid::{PositionGrid, morton_cell, morton_code};
pub use steps::AttributeSteps;
use steps::check_step;

use crate::{
    CodecError, GaussianArrays, Limits,
    adaptive::{BitDecoder, BitEncoder, LARGEST_INDEX, index, reconstruct},
    budget::Budget,
    bytes::{Reader, Section, Writer},
    limits::at_most,
};

const SECTION: &str = Section::Gaussians.name();
/// Bytes that many Gaussians take at least: what a count must show before memory is taken for it.
const GAUSSIANS_A_BYTE: usize = 8;

/// Bytes that decoding takes for a Gaussian: 56 that stay, neighbors, and the integers of the largest attribute.
const GAUSSIAN_BYTES: u64 = 136;
/// Nanoseconds to find a Gaussian's neighbors and to read its attributes where they take next to no bits.
const GAUSSIAN_NANOSECONDS: u64 = 3000;
/// Nanoseconds of a level of the tree of positions.
const LEVEL_NANOSECONDS: u64 = 12;

/// The order in which an attribute's channels are coded.
const AXES: [usize; 3] = [0, 1, 2];
const COMPONENTS: [usize; 4] = [0, 1, 2, 3];
/// Green first: it says most about the other two.
const COLORS: [usize; 3] = [1, 0, 2];

/// Coded attributes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodedAttributes {
    /// What [`decode`] reads.
    pub bytes: Vec<u8>,
    /// `order[new]` is the index that the Gaussian `new` of the decoded arrays had in the given ones. Everything else
    /// that belongs to a Gaussian, such as the higher spherical harmonics, has to follow.
    pub order: Vec<u32>,
    /// Where the bytes went.
    pub sizes: AttributeSizes,
}

/// Bytes of each part of [`EncodedAttributes::bytes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttributeSizes {
    /// Counts, steps and lengths, and the zeros at the end where there are any.
    pub overhead: usize,
    /// Positions.
    pub means: usize,
    /// Logarithms of the scales.
    pub log_scales: usize,
    /// Opacities.
    pub opacity_logits: usize,
    /// Rotations.
    pub quats: usize,
    /// Spherical harmonics of degree 0.
    pub sh_dc: usize,
}

/// Codes `N` Gaussians. `sh_degree` and `sh_rest` are left out.
///
/// # Errors
/// Arrays of different lengths, NaN and infinities, steps that are not positive, positions beyond ±1e30, and other
/// numbers beyond 2^23 steps.
pub fn encode(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<EncodedAttributes, CodecError> {
    let quantized = Quantized::of(gaussians, steps)?;
    let neighbors = quantized.neighbors();
    let mut encoder = BitEncoder::default();
    positions::code(&mut encoder, &mut quantized.codes.clone(), quantized.grid.code_bits())
        .expect("an encoder is never damaged");
    let means = encoder.finish();
    let attributes = quantized.attributes.each_ref().map(|channels| channels::encode(channels, &neighbors));

    let mut writer = Writer::default();
    quantized.head().write(&mut writer);
    writer.u32(means.len() as u32);
    attributes.iter().for_each(|stream| writer.u32(stream.len() as u32));
    writer.bytes.extend(&means);
    attributes.iter().for_each(|stream| writer.bytes.extend(stream));
    let least = gaussians.len().div_ceil(GAUSSIANS_A_BYTE);
    writer.bytes.resize(writer.bytes.len().max(least), 0);

    let [log_scales, opacity_logits, quats, sh_dc] = attributes.map(|stream| stream.len());
    let coded = means.len() + log_scales + opacity_logits + quats + sh_dc;
    let overhead = writer.bytes.len() - coded;
    let sizes = AttributeSizes { overhead, means: means.len(), log_scales, opacity_logits, quats, sh_dc };
    Ok(EncodedAttributes { bytes: writer.bytes, order: quantized.order, sizes })
}

/// Reads Gaussians, in Morton order; `sh_degree` is 0 and `sh_rest` empty.
///
/// # Errors
/// Bytes that [`encode`] does not write, and more Gaussians than the limits allow. Memory is taken for at most eight
/// Gaussians a byte.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<GaussianArrays, CodecError> {
    decode_within(bytes, &Budget::new(limits))
}

/// As [`decode`], at the cost of a budget.
pub(crate) fn decode_within(bytes: &[u8], budget: &Budget) -> Result<GaussianArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader)?;
    at_most(SECTION, "count", head.count.into(), budget.limits.gaussians)?;
    let count = head.count as usize;
    if bytes.len() < count.div_ceil(GAUSSIANS_A_BYTE) {
        let expected = format!("at most {GAUSSIANS_A_BYTE} a byte, of which there are {}", bytes.len());
        return Err(CodecError::invalid(SECTION, "count", count, expected));
    }
    let lengths: [u32; 5] = [
        reader.u32("length of means")?,
        reader.u32("length of log_scales")?,
        reader.u32("length of opacity_logits")?,
        reader.u32("length of quats")?,
        reader.u32("length of sh_dc")?,
    ];
    let [means, log_scales, opacity_logits, quats, sh_dc] = lengths;
    budget.stream(SECTION, bytes.len())?;
    let nanoseconds = GAUSSIAN_NANOSECONDS + LEVEL_NANOSECONDS * u64::from(head.grid.code_bits());
    budget.things(SECTION, count as u64, GAUSSIAN_BYTES, nanoseconds)?;

    let mut codes = vec![0; count];
    let stream = reader.take("means", means.into())?;
    positions::code(&mut BitDecoder::new(stream), &mut codes, head.grid.code_bits()).map_err(|_| damaged("means"))?;
    let cells: Vec<_> = codes.iter().map(|&code| morton_cell(code)).collect();
    drop(codes);
    let means = head.means(&cells);
    let neighbors = nearest_before(&cells);
    drop(cells);

    let mut channels = |field, count, length: u32| read_channels(&mut reader, field, count, length, &neighbors);
    let [log_scale, opacity_logit, quaternion, dc] = head.steps;
    // Each attribute's integers go before the next one's come.
    let gaussians = GaussianArrays {
        means,
        log_scales: join(&channels("log_scales", 3, log_scales)?, log_scale, AXES),
        opacity_logits: join(&channels("opacity_logits", 1, opacity_logits)?, opacity_logit, [0]).into_flattened(),
        quats: join(&channels("quats", 4, quats)?, quaternion, COMPONENTS),
        sh_dc: join(&channels("sh_dc", 3, sh_dc)?, dc, COLORS),
        ..GaussianArrays::default()
    };
    check_padding(reader, bytes.len(), count)?;
    Ok(gaussians)
}

/// What [`decode`] gives for what [`encode`] writes: the quantized Gaussians in their new order.
///
/// # Errors
/// As [`encode`].
pub fn quantized(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<GaussianArrays, CodecError> {
    let quantized = Quantized::of(gaussians, steps)?;
    Ok(reconstructed(&quantized.head(), &quantized.cells(), &quantized.attributes))
}

/// What stands before the streams.
#[derive(Clone, Copy, Debug)]
struct Head {
    count: u32,
    grid: PositionGrid,
    /// Steps of log scales, opacity logits, quaternions, spherical harmonics of degree 0.
    steps: [f32; 4],
}

impl Head {
    /// Centers of cells.
    fn means(&self, cells: &[[i32; 3]]) -> Vec<[f32; 3]> {
        cells.iter().map(|&cell| self.grid.mean(cell)).collect()
    }

    fn write(&self, writer: &mut Writer) {
        writer.u32(self.count);
        self.grid.write(writer);
        writer.f32s(&self.steps);
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, CodecError> {
        let count = reader.u32("count")?;
        let grid = PositionGrid::read(reader)?;
        let steps = reader.group("steps")?;
        for (attribute, step) in ["log_scale", "opacity_logit", "quaternion", "sh_dc"].into_iter().zip(steps) {
            check_step(attribute, step)?;
        }
        Ok(Self { count, grid, steps })
    }
}

/// Gaussians as integers, in Morton order.
struct Quantized {
    grid: PositionGrid,
    steps: [f32; 4],
    order: Vec<u32>,
    /// Morton codes of the cells, ascending.
    codes: Vec<u64>,
    /// Channels of log scales, opacity logits, quaternions, spherical harmonics of degree 0, as they are coded.
    attributes: [Vec<Vec<i32>>; 4],
}

impl Quantized {
    fn of(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<Self, CodecError> {
        explicit::check(gaussians, &Limits { gaussians: u32::MAX, ..Limits::default() })?;
        steps.check()?;
        let GaussianArrays { means, log_scales, quats, opacity_logits, sh_dc, .. } = gaussians;
        check_finite("means", means.as_flattened())?;
        check_finite("log_scales", log_scales.as_flattened())?;
        let grid = PositionGrid::new(means, steps.position * typical_size(log_scales))?;

        let codes: Vec<u64> = means.iter().map(|&mean| morton_code(grid.cell(mean))).collect();
        let mut order: Vec<u32> = (0..means.len() as u32).collect();
        order.sort_by_key(|&index| codes[index as usize]);
        let opacities = opacity_logits.as_chunks::<1>().0;
        let attributes = [
            split("log_scales", log_scales, steps.log_scale, AXES, &order)?,
            split("opacity_logits", opacities, steps.opacity_logit, [0], &order)?,
            split("quats", quats, steps.quaternion, COMPONENTS, &order)?,
            split("sh_dc", sh_dc, steps.sh_dc, COLORS, &order)?,
        ];
        let codes = order.iter().map(|&index| codes[index as usize]).collect();
        let steps = [steps.log_scale, steps.opacity_logit, steps.quaternion, steps.sh_dc];
        Ok(Self { grid, steps, order, codes, attributes })
    }

    fn head(&self) -> Head {
        Head { count: self.codes.len() as u32, grid: self.grid, steps: self.steps }
    }

    fn cells(&self) -> Vec<[i32; 3]> {
        self.codes.iter().map(|&code| morton_cell(code)).collect()
    }

    fn neighbors(&self) -> Vec<[u32; NEIGHBORS]> {
        nearest_before(&self.cells())
    }
}

/// Integers to Gaussians.
fn reconstructed(head: &Head, cells: &[[i32; 3]], attributes: &[Vec<Vec<i32>>; 4]) -> GaussianArrays {
    let [log_scales, opacity_logits, quats, sh_dc] = attributes;
    let [log_scale, opacity_logit, quaternion, dc] = head.steps;
    GaussianArrays {
        means: head.means(cells),
        log_scales: join(log_scales, log_scale, AXES),
        quats: join(quats, quaternion, COMPONENTS),
        opacity_logits: join(opacity_logits, opacity_logit, [0]).into_flattened(),
        sh_dc: join(sh_dc, dc, COLORS),
        ..GaussianArrays::default()
    }
}

/// Rows of numbers to channels of indices; `order` is that of the rows, `channels` that of the channels.
fn split<const K: usize>(
    field: &'static str,
    rows: &[[f32; K]],
    step: f32,
    channels: [usize; K],
    order: &[u32],
) -> Result<Vec<Vec<i32>>, CodecError> {
    check_finite(field, rows.as_flattened())?;
    let quantize = |row: u32, channel: usize| {
        let value = rows[row as usize][channel];
        index(value, step, 0.0).ok_or_else(|| {
            let found = format!("{value:e} in value {}", row as usize * K + channel);
            CodecError::invalid(SECTION, field, found, format!("at most {LARGEST_INDEX} steps of {step} from 0"))
        })
    };
    channels.into_iter().map(|channel| order.iter().map(|&row| quantize(row, channel)).collect()).collect()
}

/// The inverse of [`split`], in the order of the indices.
fn join<const K: usize>(indices: &[Vec<i32>], step: f32, channels: [usize; K]) -> Vec<[f32; K]> {
    let count = indices.first().map_or(0, Vec::len);
    let mut rows = vec![[0.0; K]; count];
    for (indices, channel) in indices.iter().zip(channels) {
        for (row, &index) in rows.iter_mut().zip(indices) {
            row[channel] = reconstruct(index, step, 0.0);
        }
    }
    rows
}

/// Reads an attribute, refusing what could not be reconstructed.
fn read_channels(
    reader: &mut Reader<'_>,
    field: &'static str,
    count: usize,
    length: u32,
    neighbors: &[[u32; NEIGHBORS]],
) -> Result<Vec<Vec<i32>>, CodecError> {
    let stream = reader.take(field, length.into())?;
    let channels = channels::decode(stream, count, neighbors).map_err(|_| damaged(field))?;
    match channels.iter().flatten().find(|index| index.unsigned_abs() > LARGEST_INDEX.unsigned_abs()) {
        None => Ok(channels),
        Some(index) => {
            let expected = format!("at most {LARGEST_INDEX} steps from 0");
            Err(CodecError::invalid(SECTION, field, format!("{index} steps"), expected))
        }
    }
}

/// Refuses anything behind the streams but the zeros that `count` asks for.
fn check_padding(reader: Reader<'_>, all: usize, count: usize) -> Result<(), CodecError> {
    let mut reader = reader;
    if all == count.div_ceil(GAUSSIANS_A_BYTE) {
        while reader.demand("zeros", 1).is_ok() {
            if reader.u8("zeros")? != 0 {
                return Err(CodecError::invalid(SECTION, "zeros at the end", "something else", "zeros"));
            }
        }
    }
    reader.finish()
}

fn check_finite(field: &'static str, values: &[f32]) -> Result<(), CodecError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            Err(CodecError::NonFinite { section: SECTION, field: field.into(), index, value: values[index] })
        }
    }
}

fn damaged(field: &'static str) -> CodecError {
    CodecError::invalid(SECTION, field, "damaged or cut short", "a range-coded stream")
}

/// The median over the Gaussians of the geometric mean of the scales, in world units; 1 where there are none.
fn typical_size(log_scales: &[[f32; 3]]) -> f32 {
    let mut logarithms: Vec<f32> = log_scales.iter().map(|[x, y, z]| x / 3.0 + y / 3.0 + z / 3.0).collect();
    if logarithms.is_empty() {
        return 1.0;
    }
    let middle = logarithms.len() / 2;
    let (_, median, _) = logarithms.select_nth_unstable_by(middle, f32::total_cmp);
    median.exp()
}
