//! Entropy-coded spherical harmonics beyond degree 0.

use super::{SectionKind, sh::Head, weights};
use crate::{
    CodecError, Encoding, GaussianArrays, Limits, LinearLayer, ShCoding, ShCondition,
    adaptive::Damaged,
    entropy::{SymbolReader, SymbolWriter, read_tables, write_tables},
    harmonics::{Conditions, HarmonicsModel, layer_shapes, walk},
    limits::at_most,
    network_weights::{TensorLength, WeightPrecision},
    reader::Reader,
    sh_rest_coefficients,
    writer::Writer,
};

const SECTION: &str = SectionKind::Sh.name();

impl ShCoding {
    pub(crate) fn encoding(&self) -> Encoding {
        match self {
            Self::Tables { .. } => Encoding::FrequencyTables,
            Self::Conditional { kind: ShCondition::Autoregressive, .. } => Encoding::Autoregressive,
            Self::Conditional { kind: ShCondition::HexplaneCoupled, .. } => Encoding::HexplaneCoupled,
        }
    }

    fn step(&self) -> f32 {
        match self {
            Self::Tables { step, .. } | Self::Conditional { step, .. } => *step,
        }
    }

    /// Refuses a step, tables or layers that do not fit the degree and the features of the hexplane.
    fn check(&self, degree: u8, features: u64) -> Result<(), CodecError> {
        let step = self.step();
        if !(step.is_normal() && step > 0.0) {
            return Err(CodecError::invalid(SECTION, "step", step, "a positive normal number"));
        }
        match self {
            Self::Tables { tables, .. } => {
                let channels = 3 * sh_rest_coefficients(degree);
                if tables.len() != channels {
                    let expected = format!("{channels}, one a channel of degree {degree}");
                    return Err(CodecError::invalid(SECTION, "number of tables", tables.len(), expected));
                }
            }
            Self::Conditional { kind, layers, .. } => {
                let hidden: Vec<u32> = layers.iter().step_by(2).map(|layer| layer.outputs).collect();
                let expected = layer_shapes(*kind, degree, features, &hidden);
                let found: Vec<_> = layers.iter().map(|layer| (layer.inputs.into(), layer.outputs.into())).collect();
                let wanted = if *kind == ShCondition::Autoregressive { degree } else { degree.min(1) };
                if found != expected || hidden.len() != usize::from(wanted) {
                    let found = format!("{found:?} (inputs, outputs)");
                    let expected = format!("{wanted} networks of two layers, {expected:?} with those hidden widths");
                    return Err(CodecError::invalid(SECTION, "layers", found, expected));
                }
                for LinearLayer { name, inputs, outputs, weight, bias } in layers {
                    let weights = u64::from(*inputs) * u64::from(*outputs);
                    super::check_length(
                        SECTION,
                        format!("{name}.weight"),
                        weight.len(),
                        weights,
                        "inputs times outputs",
                    )?;
                    super::check_length(SECTION, format!("{name}.bias"), bias.len(), (*outputs).into(), "outputs")?;
                    if *inputs == 0 || *outputs == 0 {
                        return Err(CodecError::invalid(SECTION, format!("sizes of {name}"), 0, "1 or more"));
                    }
                    for values in [weight, bias] {
                        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                            let value = values[index];
                            return Err(CodecError::NonFinite { section: SECTION, field: name.clone(), index, value });
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes tables or networks, and returns them as a decoder gets them.
    fn write(&self, precision: Option<WeightPrecision>, writer: &mut Writer) -> Result<Self, CodecError> {
        match self {
            Self::Tables { tables, .. } => {
                writer.block(&write_tables(tables));
                Ok(self.clone())
            }
            Self::Conditional { step, kind, layers } => {
                layers.iter().step_by(2).for_each(|layer| writer.varint(layer.outputs.into()));
                let tensors: Vec<weights::Tensor<'_>> = layers
                    .iter()
                    .flat_map(|layer| [&layer.weight, &layer.bias].map(|values| (&layer.name[..], &values[..])))
                    .collect();
                let encoded = weights::encode(SECTION, &tensors, precision)?;
                writer.u8(precision.is_some().into());
                writer.block(&encoded.bytes);
                let pairs = encoded.tensors.as_chunks::<2>().0;
                let decoded = |(layer, [weight, bias]): (&LinearLayer, &[Vec<f32>; 2])| LinearLayer {
                    weight: weight.clone(),
                    bias: bias.clone(),
                    ..layer.clone()
                };
                let layers = layers.iter().zip(pairs).map(decoded).collect();
                Ok(Self::Conditional { step: *step, kind: *kind, layers })
            }
        }
    }

    fn read(
        reader: &mut Reader<'_>,
        encoding: Encoding,
        degree: u8,
        features: u64,
        limits: &Limits,
    ) -> Result<Self, CodecError> {
        let step = reader.f32("step")?;
        let kind = match encoding {
            Encoding::Autoregressive => ShCondition::Autoregressive,
            Encoding::HexplaneCoupled => ShCondition::HexplaneCoupled,
            _ => {
                let block = reader.block("tables")?;
                let tables = read_tables(block, 3 * sh_rest_coefficients(degree))
                    .map_err(|Damaged| CodecError::invalid(SECTION, "tables", "damaged", "frequency tables"))?;
                return Ok(Self::Tables { step, tables });
            }
        };
        let networks = if kind == ShCondition::Autoregressive { degree } else { degree.min(1) };
        let hidden = (0..networks)
            .map(|_| reader.varint_at_most("hidden width", limits.layer_width))
            .collect::<Result<Vec<_>, _>>()?;
        let shapes = layer_shapes(kind, degree, features, &hidden);
        let lengths: Vec<_> = shapes
            .iter()
            .flat_map(|&(inputs, outputs)| [inputs.saturating_mul(outputs), outputs])
            .map(|length| TensorLength { name: "weights", length })
            .collect();
        let total = lengths.iter().fold(0u64, |sum, tensor| sum.saturating_add(tensor.length));
        at_most(SECTION, "number of weights", total, limits.layer_weights)?;
        let quantised = match reader.u8("precision of the weights")? {
            0 => false,
            1 => true,
            other => return Err(CodecError::invalid(SECTION, "precision of the weights", other, "0 or 1")),
        };
        let mut tensors = weights::decode(SECTION, reader.block("weights")?, quantised, &lengths, limits)?.into_iter();
        let mut next = || tensors.next().expect("a tensor for each length");
        let layers = shapes
            .iter()
            .map(|&(inputs, outputs)| LinearLayer {
                name: "network".into(),
                inputs: inputs as u32,
                outputs: outputs as u32,
                weight: next(),
                bias: next(),
            })
            .collect();
        Ok(Self::Conditional { step, kind, layers })
    }
}

/// Bytes of the spherical harmonics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShBytes {
    /// Head, tables or networks.
    pub model: u64,
    /// The symbols of each degree, from 1.
    pub degrees: Vec<u64>,
}

fn features(conditions: Conditions<'_>) -> u64 {
    u64::from(conditions.hexplane.channels) * conditions.hexplane.multipliers.len() as u64
}

/// Writes `sh_rest` of Gaussians in their final order; returns it as a decoder gets it.
pub(crate) fn write(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    precision: Option<WeightPrecision>,
    conditions: Conditions<'_>,
    writer: &mut Writer,
) -> Result<(Vec<f32>, ShBytes), CodecError> {
    let degree = gaussians.sh_degree;
    coding.check(degree, features(conditions))?;
    let start = writer.bytes.len();
    writer.varint(gaussians.len() as u64);
    writer.u8(degree);
    writer.f32(coding.step());
    let coding = coding.write(precision, writer)?;

    let mut values = gaussians.sh_rest.clone();
    let mut writers: Vec<SymbolWriter> = (0..degree).map(|_| SymbolWriter::default()).collect();
    let mut model = HarmonicsModel::new(&coding, conditions);
    walk(&mut model, coding.step(), degree, &mut values, &mut writers).map_err(|Damaged| {
        let found = format!("more than 4194304 steps of {}", coding.step());
        CodecError::invalid(SECTION, "a value of sh_rest", found, "fewer; make the step larger")
    })?;
    let streams: Vec<_> = writers.iter().map(|writer| writer.finish(model.distributions())).collect();
    streams.iter().for_each(|stream| writer.varint(stream.len() as u64));
    let model = (writer.bytes.len() - start) as u64;
    streams.iter().for_each(|stream| writer.bytes.extend_from_slice(stream));
    Ok((values, ShBytes { model, degrees: streams.iter().map(|stream| stream.len() as u64).collect() }))
}

/// The head alone.
pub(crate) fn read_head(reader: &mut Reader<'_>, limits: &Limits) -> Result<Head, CodecError> {
    let head = Head { count: reader.varint_at_most("count", limits.gaussians)?, degree: reader.u8("degree")? };
    head.check()?;
    Ok(head)
}

/// The head and the coefficients.
pub(crate) fn read(
    bytes: &[u8],
    encoding: Encoding,
    conditions: Conditions<'_>,
    limits: &Limits,
) -> Result<(Head, Vec<f32>), CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let head = read_head(&mut reader, limits)?;
    if head.count as usize != conditions.gaussians.len() {
        let expected = format!("{}, the number of Gaussians", conditions.gaussians.len());
        return Err(CodecError::invalid(SECTION, "count", head.count, expected));
    }
    at_most(SECTION, "number of values", head.values(), limits.coded_values)?;
    let coding = ShCoding::read(&mut reader, encoding, head.degree, features(conditions), limits)?;
    coding.check(head.degree, features(conditions))?;
    if let ShCoding::Conditional { layers, .. } = &coding {
        let weights: u64 = layers.iter().map(|layer| layer.weight.len() as u64).sum();
        let work = u64::from(head.count).saturating_mul(weights);
        at_most(SECTION, "number of multiplications", work, limits.multiplications)?;
    }

    let lengths = (0..head.degree).map(|_| reader.varint("length of a sub-stream")).collect::<Result<Vec<_>, _>>()?;
    let damaged = |Damaged| CodecError::invalid(SECTION, "symbols", "damaged", "what an encoder writes");
    let mut readers = Vec::new();
    for length in lengths {
        readers.push(SymbolReader::new(reader.take("sub-stream", length)?).map_err(damaged)?);
    }
    reader.finish()?;
    let mut values = vec![0.0; head.values() as usize];
    let mut model = HarmonicsModel::new(&coding, conditions);
    walk(&mut model, coding.step(), head.degree, &mut values, &mut readers).map_err(damaged)?;
    readers.into_iter().try_for_each(SymbolReader::finish).map_err(damaged)?;
    Ok((head, values))
}
