//! Gaussians as integers.

use super::{
    AttributeInfo, AttributeSteps, BitEncoder, NEIGHBORS, Numbers, PositionGrid, SECTION, channels, check,
    neighbors::all_nearest_before,
    position_grid::{cell_point, morton_cell},
    positions,
};
use crate::{
    AttributeValues, CodecError, Coder, GaussianArrays, Limits,
    adaptive::{LARGEST_INDEX, index, reconstruct},
    bytes::Writer,
    scene::{BUILT_IN, SH_REST},
};

/// Gaussians as integers, in Morton order.
pub(super) struct Quantized {
    grid: PositionGrid,
    pub(super) order: Vec<u32>,
    /// Morton codes of the cells, ascending.
    codes: Vec<u64>,
    /// In the order of the stream.
    pub(super) attributes: Vec<QuantizedAttribute>,
}

/// One attribute.
pub(super) struct QuantizedAttribute {
    name: String,
    width: usize,
    optional: bool,
    coder: Coder,
    numbers: Integers,
}

enum Integers {
    /// The cells of [`Quantized::codes`].
    Cells,
    /// Channel by channel, as they are coded.
    Channels { step: f32, channels: Vec<Vec<i32>> },
    /// Not quantized; `[N, width]`.
    Float32(Vec<f32>),
}

impl Quantized {
    pub(super) fn of(gaussians: &GaussianArrays, steps: &AttributeSteps) -> Result<Self, CodecError> {
        check(gaussians, &Limits { gaussians: u32::MAX, ..Limits::default() })?;
        steps.check()?;
        let GaussianArrays { means, log_scales, .. } = gaussians;
        check_finite("means", means.as_flattened())?;
        check_finite("log_scales", log_scales.as_flattened())?;
        let [positions, ..] = BUILT_IN;
        let step = steps.of(positions.name).unwrap_or(positions.step);
        let grid = PositionGrid::new(means, step * typical_size(log_scales))?;

        let (order, codes) = grid.sorted(means);
        let attributes = gaussians.attributes().filter(|attribute| attribute.name != SH_REST);
        let attributes = attributes.map(|attribute| QuantizedAttribute::of(attribute, steps, &order));
        let attributes = attributes.collect::<Result<_, _>>()?;
        Ok(Self { grid, order, codes, attributes })
    }

    /// The Gaussians of each layer, by their indices in the given arrays; each layer in Morton order.
    pub(super) fn into_layers(self, layers: &[Vec<u32>]) -> Vec<Self> {
        if layers.len() == 1 {
            return vec![self];
        }
        let mut layer_of = vec![0; self.order.len()];
        for (number, layer) in layers.iter().enumerate() {
            layer.iter().for_each(|&row| layer_of[row as usize] = number);
        }
        let mut places = vec![Vec::new(); layers.len()];
        for (place, &row) in self.order.iter().enumerate() {
            places[layer_of[row as usize]].push(place);
        }
        places.iter().map(|places| self.select(places)).collect()
    }

    fn select(&self, places: &[usize]) -> Self {
        Self {
            grid: self.grid,
            order: places.iter().map(|&place| self.order[place]).collect(),
            codes: places.iter().map(|&place| self.codes[place]).collect(),
            attributes: self.attributes.iter().map(|attribute| attribute.select(places)).collect(),
        }
    }

    fn cells(&self) -> Vec<[i32; 3]> {
        self.codes.iter().map(|&code| morton_cell(code)).collect()
    }

    pub(super) fn neighbors(&self) -> Vec<[u32; NEIGHBORS]> {
        all_nearest_before(&self.cells().into_iter().map(cell_point).collect::<Vec<_>>())
    }

    /// The Gaussians as a decoder gets them.
    pub(super) fn reconstructed(&self) -> GaussianArrays {
        let mut numbers = Numbers::default();
        for attribute in &self.attributes {
            let values = match &attribute.numbers {
                Integers::Cells => self.cells().into_iter().flat_map(|cell| self.grid.mean(cell)).collect(),
                Integers::Channels { step, channels } => join(channels, *step, attribute.coder),
                Integers::Float32(values) => values.clone(),
            };
            numbers.add(&attribute.info(0), values);
        }
        numbers.into_gaussians()
    }
}

impl QuantizedAttribute {
    fn of(attribute: AttributeValues<'_>, steps: &AttributeSteps, order: &[u32]) -> Result<Self, CodecError> {
        let AttributeValues { name, width, values, optional } = attribute;
        check_finite(name, values)?;
        let built_in = BUILT_IN.iter().find(|row| row.name == name);
        let step = steps.of(name).or(built_in.map(|row| row.step));
        let coder = match (built_in, step) {
            (Some(row), _) => row.coder,
            (None, Some(_)) => Coder::Channels,
            (None, None) => Coder::Float32,
        };
        let numbers = match (coder, step) {
            (Coder::Grid, _) => Integers::Cells,
            (Coder::Channels | Coder::Colors, Some(step)) => {
                Integers::Channels { step, channels: split(attribute, step, coder, order)? }
            }
            _ => Integers::Float32(
                order.iter().flat_map(|&row| &values[row as usize * width..][..width]).copied().collect(),
            ),
        };
        Ok(Self { name: name.to_owned(), width, optional, coder, numbers })
    }

    fn select(&self, places: &[usize]) -> Self {
        let of_channel = |indices: &Vec<i32>| places.iter().map(|&place| indices[place]).collect();
        let numbers = match &self.numbers {
            Integers::Cells => Integers::Cells,
            Integers::Channels { step, channels } => {
                Integers::Channels { step: *step, channels: channels.iter().map(of_channel).collect() }
            }
            Integers::Float32(values) => Integers::Float32(
                places.iter().flat_map(|&place| &values[place * self.width..][..self.width]).copied().collect(),
            ),
        };
        Self { name: self.name.clone(), numbers, ..*self }
    }

    /// Its row in the list of a section.
    pub(super) fn info(&self, bytes: usize) -> AttributeInfo {
        let Self { name, width, optional, coder, .. } = self;
        AttributeInfo {
            name: name.clone(),
            width: *width as u32,
            coder: *coder,
            optional: *optional,
            bytes: bytes as u64,
        }
    }

    /// Its bytes.
    pub(super) fn write(&self, gaussians: &Quantized, neighbors: &[[u32; NEIGHBORS]], writer: &mut Writer) {
        match &self.numbers {
            Integers::Cells => {
                gaussians.grid.write(writer);
                let mut encoder = BitEncoder::default();
                positions::code(&mut encoder, &mut gaussians.codes.clone(), gaussians.grid.code_bits())
                    .expect("an encoder is never damaged");
                writer.bytes.extend(encoder.finish());
            }
            Integers::Channels { step, channels } => {
                writer.f32(*step);
                writer.bytes.extend(channels::encode(channels, neighbors));
            }
            Integers::Float32(values) => writer.f32s(values),
        }
    }
}

/// Which of an attribute's channels is coded first, second, and so on.
fn place(coded: usize, coder: Coder) -> usize {
    match coder {
        // Green first: the other two are predicted best from it.
        Coder::Colors => [1, 0, 2][coded],
        _ => coded,
    }
}

/// Rows of numbers to channels of indices, in the order in which they are coded; `order` is the order of the rows.
fn split(attribute: AttributeValues<'_>, step: f32, coder: Coder, order: &[u32]) -> Result<Vec<Vec<i32>>, CodecError> {
    let AttributeValues { name, width, values, .. } = attribute;
    let quantize = |row: u32, channel: usize| {
        let at = row as usize * width + channel;
        index(values[at], step, 0.0).ok_or_else(|| {
            let found = format!("{:e} in value {at}", values[at]);
            CodecError::invalid(SECTION, name, found, format!("at most {LARGEST_INDEX} steps of {step} from 0"))
        })
    };
    let channels = (0..width).map(|coded| place(coded, coder));
    channels.map(|channel| order.iter().map(|&row| quantize(row, channel)).collect()).collect()
}

/// The inverse of [`split`], in the order of the indices: `[N, width]`.
pub(super) fn join(channels: &[Vec<i32>], step: f32, coder: Coder) -> Vec<f32> {
    let (width, count) = (channels.len(), channels.first().map_or(0, Vec::len));
    let mut values = vec![0.0; width * count];
    for (coded, indices) in channels.iter().enumerate() {
        let channel = place(coded, coder);
        for (row, &index) in values.chunks_exact_mut(width).zip(indices) {
            row[channel] = reconstruct(index, step, 0.0);
        }
    }
    values
}

fn check_finite(field: &str, values: &[f32]) -> Result<(), CodecError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            Err(CodecError::NonFinite { section: SECTION, field: field.into(), index, value: values[index] })
        }
    }
}

/// The median over the Gaussians of the geometric mean of the scales, in world units; 1 where there are none.
pub fn typical_size(log_scales: &[[f32; 3]]) -> f32 {
    let mut logarithms: Vec<f32> = log_scales.iter().map(|[x, y, z]| x / 3.0 + y / 3.0 + z / 3.0).collect();
    if logarithms.is_empty() {
        return 1.0;
    }
    let middle = logarithms.len() / 2;
    let (_, median, _) = logarithms.select_nth_unstable_by(middle, f32::total_cmp);
    median.exp()
}
