//! How the Gaussians move, as bytes.

use crate::{
    CodecError, Limits, MotionArrays, MotionNetwork, MotionOutput, MotionSource, NamedTensor, Network,
    budget::Budget,
    bytes::{Reader, Section, Writer, sections::Encoding},
    network::{
        tensors::{StoredTensor, read_tensors, write_tensors},
        weights::{TensorLength, WeightPrecision},
    },
};

const SECTION: &str = Section::Motion.name();
/// Numbers of the kinds of sources. After the last one a name follows.
const FEATURES: u8 = 0;
const POINT: u8 = 1;
const TIME: u8 = 2;
const ATTRIBUTE: u8 = 3;

/// Writes checked arrays, as float32 where there is no precision; returns them as a decoder gets them.
pub(crate) fn write(
    motion: &MotionArrays,
    precision: Option<WeightPrecision>,
    writer: &mut Writer,
) -> Result<MotionArrays, CodecError> {
    writer.block(motion.kind.as_bytes());
    writer.u8(motion.network.is_some().into());
    let mut tensors = Vec::new();
    if let Some(MotionNetwork { network, sources, outputs }) = &motion.network {
        network.write(writer);
        for source in sources {
            match source {
                MotionSource::Features => writer.u8(FEATURES),
                MotionSource::Point => writer.u8(POINT),
                MotionSource::Time => writer.u8(TIME),
                MotionSource::Attribute(name) => {
                    writer.u8(ATTRIBUTE);
                    writer.block(name.as_bytes());
                }
            }
        }
        outputs.iter().for_each(|&output| writer.u8(output as u8));
        tensors = network.stored_tensors();
    }
    writer.varint(motion.tensors.len() as u64);
    for NamedTensor { name, shape, values } in &motion.tensors {
        writer.block(name.as_bytes());
        writer.varint(shape.len() as u64);
        shape.iter().for_each(|&side| writer.varint(side.into()));
        let row = shape.last().map_or(1, |side| *side as usize);
        tensors.push(StoredTensor { values: values.clone(), row });
    }
    let mut decoded = motion.clone();
    set_tensors(&mut decoded, write_tensors(SECTION, tensors, precision, writer)?);
    Ok(decoded)
}

fn set_tensors(motion: &mut MotionArrays, tensors: Vec<Vec<f32>>) {
    let mut tensors = tensors.into_iter();
    if let Some(MotionNetwork { network, .. }) = &mut motion.network {
        network.set_stored_tensors(&mut tensors);
    }
    motion.tensors.iter_mut().zip(tensors).for_each(|(tensor, values)| tensor.values = values);
}

fn read_text(reader: &mut Reader<'_>, field: &str, limits: &Limits) -> Result<String, CodecError> {
    let length = reader.varint_at_most(&format!("length of {field}"), limits.name_bytes)?;
    let bytes = reader.take(field, length.into())?;
    let text = std::str::from_utf8(bytes).map_err(|error| CodecError::invalid(SECTION, field, error, "UTF-8"))?;
    Ok(text.to_owned())
}

fn unknown(field: &str, number: u8, known: usize) -> CodecError {
    CodecError::invalid(SECTION, field, number, format!("less than {known}; use a newer program"))
}

fn read_source(reader: &mut Reader<'_>, limits: &Limits) -> Result<MotionSource, CodecError> {
    let field = "a source of the network";
    Ok(match reader.u8(field)? {
        FEATURES => MotionSource::Features,
        POINT => MotionSource::Point,
        TIME => MotionSource::Time,
        ATTRIBUTE => MotionSource::Attribute(read_text(reader, "name of an attribute", limits)?),
        other => return Err(unknown(field, other, usize::from(ATTRIBUTE) + 1)),
    })
}

fn read_output(reader: &mut Reader<'_>) -> Result<MotionOutput, CodecError> {
    let (field, all) = ("an output of the network", MotionOutput::ALL);
    let number = reader.u8(field)?;
    all.get(usize::from(number)).copied().ok_or_else(|| unknown(field, number, all.len()))
}

/// Reads the arrays without their numbers.
pub(crate) fn read_description(reader: &mut Reader<'_>, limits: &Limits) -> Result<MotionArrays, CodecError> {
    let kind = read_text(reader, "kind", limits)?;
    let network = match reader.u8("presence of a network")? {
        0 => None,
        1 => {
            let network = Network::read(reader, SECTION, "the network", limits)?;
            let sources = network.inputs.iter().map(|_| read_source(reader, limits)).collect::<Result<_, _>>()?;
            let outputs = network.outputs.iter().map(|_| read_output(reader)).collect::<Result<_, _>>()?;
            Some(MotionNetwork { network, sources, outputs })
        }
        other => return Err(CodecError::invalid(SECTION, "presence of a network", other, "0 or 1")),
    };
    let count = reader.varint_at_most("number of tensors", limits.nodes)?;
    let mut tensors = Vec::new();
    for _ in 0..count {
        let name = read_text(reader, "name of a tensor", limits)?;
        let axes = reader.varint_at_most("axes of a tensor", 8)?;
        let shape = (0..axes).map(|_| reader.varint_at_most("side of a tensor", u32::MAX)).collect::<Result<_, _>>()?;
        tensors.push(NamedTensor { name, shape, values: Vec::new() });
    }
    let motion = MotionArrays { kind, network, tensors };
    motion.check_structure(limits)?;
    Ok(motion)
}

/// Reads the arrays.
pub(crate) fn read(bytes: &[u8], encoding: Encoding, budget: &Budget) -> Result<MotionArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let mut motion = read_description(&mut reader, &budget.limits)?;
    let network = motion.network.iter().flat_map(|motion| motion.network.tensor_lengths("weights"));
    let named = motion.tensors.iter().map(|tensor| TensorLength { name: &tensor.name, length: tensor.length() });
    let lengths: Vec<_> = network.chain(named).collect();
    let tensors = read_tensors(SECTION, reader.rest(), encoding, &lengths, budget)?;
    set_tensors(&mut motion, tensors);
    Ok(motion)
}
