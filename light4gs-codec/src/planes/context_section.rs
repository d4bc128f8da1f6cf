//! The context model of the planes as bytes: its description, the latent's tables, the weights.

use super::context_model::{
    Condition, ContextModelArrays, LatentArrays, PlanePrior, PlaneSource, SECTION, network_name,
};
use crate::{
    CodecError, Limits, Network, PerGroup,
    budget::Budget,
    bytes::{Reader, Writer, sections::Encoding},
    entropy::{read_tables, write_tables},
    network::{
        tensors::{read_weights, write_weights},
        weights::WeightPrecision,
    },
    plane_layout::PlaneAxes,
};

const ANCHORS: u64 = 6;
const LATENT: u64 = 7;
const LOWER_SCALE: u64 = 8;

/// Writes a checked model, with float32 weights where there is no precision; returns it as a decoder gets it.
pub(crate) fn write(
    model: &ContextModelArrays,
    precision: Option<WeightPrecision>,
    writer: &mut Writer,
) -> Result<ContextModelArrays, CodecError> {
    let ContextModelArrays { channels, centers, latent, networks, priors, plane_priors } = model;
    writer.varint((*channels).into());
    writer.f32s(&[centers.space_only, centers.space_time]);
    writer.varint(model.latent_channels().into());
    writer.varint(networks.len() as u64);
    networks.iter().for_each(|network| network.write(writer));
    writer.varint(priors.len() as u64);
    priors.iter().for_each(|prior| write_prior(prior, writer));
    writer.varint(plane_priors.len() as u64);
    plane_priors.iter().for_each(|&prior| writer.varint(prior.into()));
    if let Some(LatentArrays { tables, medians }) = latent {
        writer.block(&write_tables(tables));
        writer.f32s(medians);
    }
    let mut decoded = model.clone();
    write_weights(SECTION, &mut decoded.networks.iter_mut().collect::<Vec<_>>(), precision, writer)?;
    Ok(decoded)
}

fn write_prior(prior: &PlanePrior, writer: &mut Writer) {
    writer.varint(prior.distribution.into());
    writer.varint(prior.conditions.len() as u64);
    for condition in &prior.conditions {
        let Some(Condition { network, sources }) = condition else {
            writer.varint(0);
            continue;
        };
        writer.varint(u64::from(*network) + 1);
        // Their number is known: one for each input of the network.
        for &source in sources {
            writer.varint(match source {
                PlaneSource::SameScale(axes) => axes as u64,
                PlaneSource::Anchors => ANCHORS,
                PlaneSource::Latent => LATENT,
                PlaneSource::LowerScale => LOWER_SCALE,
            });
        }
    }
}

fn read_prior(reader: &mut Reader<'_>, networks: &[Network], limits: &Limits) -> Result<PlanePrior, CodecError> {
    let distribution = reader.varint_at_most("distribution of a prior", limits.networks)?;
    let count = reader.varint_at_most("number of conditions of a prior", limits.nodes)?;
    let mut conditions = Vec::new();
    for _ in 0..count {
        let Some(network) = reader.varint_at_most("network of a condition", limits.networks)?.checked_sub(1) else {
            conditions.push(None);
            continue;
        };
        let Some(inputs) = networks.get(network as usize).map(|network| network.inputs.len()) else {
            let expected = format!("less than {}", networks.len());
            return Err(CodecError::invalid(SECTION, "network of a condition", network, expected));
        };
        let mut sources = Vec::new();
        for _ in 0..inputs {
            sources.push(match reader.varint("a source of a condition")? {
                axes @ 0..6 => PlaneSource::SameScale(PlaneAxes::ALL[axes as usize]),
                ANCHORS => PlaneSource::Anchors,
                LATENT => PlaneSource::Latent,
                LOWER_SCALE => PlaneSource::LowerScale,
                other => return Err(CodecError::invalid(SECTION, "a source of a condition", other, "0 to 8")),
            });
        }
        conditions.push(Some(Condition { network, sources }));
    }
    Ok(PlanePrior { conditions, distribution })
}

/// Reads the description alone; the weights are empty, and the latent has only its number of channels.
pub(crate) fn read_description(reader: &mut Reader<'_>, limits: &Limits) -> Result<ContextModelArrays, CodecError> {
    let channels = reader.varint_at_most("channels", limits.channels)?;
    let centers = PerGroup {
        space_only: reader.finite("center of space-only planes")?,
        space_time: reader.finite("center of space-time planes")?,
    };
    let latent_channels = reader.varint_at_most("channels of the latent", limits.channels)?;
    let latent = (latent_channels > 0)
        .then(|| LatentArrays { tables: Vec::new(), medians: vec![0.0; latent_channels as usize] });
    let count = reader.varint_at_most("number of networks", limits.networks)?;
    let networks = (0..count as usize)
        .map(|index| Network::read(reader, SECTION, &network_name(index), limits))
        .collect::<Result<Vec<_>, _>>()?;
    let count = reader.varint_at_most("number of priors", limits.networks)?;
    let priors = (0..count).map(|_| read_prior(reader, &networks, limits)).collect::<Result<Vec<_>, _>>()?;
    let count = reader.varint_at_most("number of planes", limits.planes())?;
    let plane_priors =
        (0..count).map(|_| reader.varint_at_most("prior of a plane", limits.networks)).collect::<Result<_, _>>()?;
    let model = ContextModelArrays { channels, centers, latent, networks, priors, plane_priors };
    model.check_structure(limits)?;
    Ok(model)
}

/// Reads a model.
pub(crate) fn read(bytes: &[u8], encoding: Encoding, budget: &Budget) -> Result<ContextModelArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let mut model = read_description(&mut reader, &budget.limits)?;
    if let Some(latent) = &mut model.latent {
        let count = latent.medians.len();
        let block = reader.block("tables of the latent")?;
        latent.tables = read_tables(SECTION, "tables of the latent", block, count, budget)?;
        latent.medians = reader.f32s("medians of the latent", count as u64)?;
    }
    let mut networks: Vec<_> = model.networks.iter_mut().collect();
    read_weights(SECTION, &mut networks, reader.rest(), encoding, budget)?;
    model.check(&budget.limits)?;
    Ok(model)
}
