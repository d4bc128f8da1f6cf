//! The bytes of the spherical harmonics beyond degree 0.

use super::{
    channels,
    coding::{Conditions, SECTION, ShCoding, ShPrior, ShSource, check_priors, prior_name},
    walk::{HarmonicsModel, walk},
};
use crate::{
    CodecError, Distributions, GaussianArrays, Limits, Network,
    adaptive::Damaged,
    attributes,
    budget::Budget,
    bytes::{
        Reader, Writer, check_length,
        sections::{Encoding, Kind},
    },
    entropy::{READ_NANOSECONDS, SymbolReader, SymbolWriter, read_tables, write_tables},
    network::{
        kernels::LANES,
        tensors::{read_weights, write_weights},
        weights::WeightPrecision,
    },
    planes::bounded_mean,
    sh_rest_coefficients,
};

/// The head of the section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    pub(crate) count: u32,
    pub(crate) degree: u8,
}

impl Head {
    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let head = Self { count: reader.varint_at_most("count", limits.gaussians)?, degree: reader.u8("degree")? };
        check_degree(head.degree)?;
        Ok(head)
    }

    pub(crate) fn of(gaussians: &GaussianArrays) -> Self {
        Self { count: gaussians.len() as u32, degree: gaussians.sh_degree }
    }

    fn write(self, writer: &mut Writer) {
        writer.varint(self.count.into());
        writer.u8(self.degree);
    }

    /// The number of coefficients of all Gaussians.
    fn values(self) -> u64 {
        u64::from(self.count) * sh_rest_coefficients(self.degree) as u64 * 3
    }
}

fn check_degree(degree: u8) -> Result<(), CodecError> {
    if degree <= 3 { Ok(()) } else { Err(CodecError::invalid(SECTION, "degree", degree, "0, 1, 2 or 3")) }
}

/// Refuses an unknown degree, and an array whose length does not follow from the degree.
pub(crate) fn check(gaussians: &GaussianArrays) -> Result<(), CodecError> {
    check_degree(gaussians.sh_degree)?;
    let (count, rest) = (gaussians.len(), sh_rest_coefficients(gaussians.sh_degree));
    let why = format!("{count} Gaussians, {rest} coefficients, 3 channels");
    check_length(SECTION, "sh_rest", gaussians.sh_rest.len(), count as u64 * rest as u64 * 3, &why)
}

/// Bytes of the spherical harmonics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShBytes {
    /// Head, tables or networks.
    pub model: u64,
    /// The symbols of each degree, from 1.
    pub degrees: Vec<u64>,
}

/// Writes `sh_rest` as float32.
pub(crate) fn write_explicit(gaussians: &GaussianArrays, writer: &mut Writer) {
    Head::of(gaussians).write(writer);
    writer.f32s(&gaussians.sh_rest);
}

impl ShCoding {
    pub(crate) fn kind(&self) -> Kind {
        match self {
            Self::Tables { .. } => Kind::ShTables,
            Self::Networks { .. } => Kind::ShNetworks,
            Self::Channels { .. } => Kind::ShChannels,
        }
    }

    /// Writes step and tables or networks, and returns them as a decoder gets them.
    fn write(&self, precision: Option<WeightPrecision>, writer: &mut Writer) -> Result<Self, CodecError> {
        writer.f32(self.step());
        match self {
            Self::Tables { tables, .. } => {
                writer.block(&write_tables(tables));
                Ok(self.clone())
            }
            Self::Channels { .. } => Ok(self.clone()),
            Self::Networks { step, priors } => {
                writer.varint(priors.len() as u64);
                for ShPrior { network, sources } in priors {
                    network.write(writer);
                    sources.iter().for_each(|source| writer.varint(source.number()));
                }
                let mut priors = priors.clone();
                let mut weights = Writer::default();
                let mut networks: Vec<_> = priors.iter_mut().map(|prior| &mut prior.network).collect();
                write_weights(SECTION, &mut networks, precision, &mut weights)?;
                writer.block(&weights.bytes);
                Ok(Self::Networks { step: *step, priors })
            }
        }
    }

    fn read(
        reader: &mut Reader<'_>,
        (kind, encoding): (Kind, Encoding),
        degree: u8,
        features: u64,
        budget: &Budget,
    ) -> Result<Self, CodecError> {
        let limits = &budget.limits;
        let step = reader.f32("step")?;
        let channels = 3 * sh_rest_coefficients(degree);
        if kind == Kind::ShChannels {
            return Ok(Self::Channels { step });
        }
        if kind == Kind::ShTables {
            let block = reader.block("tables")?;
            let tables = read_tables(SECTION, "tables", block, channels, budget)?;
            return Ok(Self::Tables { step, tables });
        }
        let mut priors = read_priors(reader, limits)?;
        check_priors(&priors, channels as u64, features, limits)?;
        let mut networks: Vec<_> = priors.iter_mut().map(|prior| &mut prior.network).collect();
        read_weights(SECTION, &mut networks, reader.block("weights")?, encoding, budget)?;
        Ok(Self::Networks { step, priors })
    }
}

/// Priors without weights.
fn read_priors(reader: &mut Reader<'_>, limits: &Limits) -> Result<Vec<ShPrior>, CodecError> {
    let count = reader.varint_at_most("number of priors", limits.networks)?;
    let read = |index| {
        let network = Network::read(reader, SECTION, &prior_name(index), limits)?;
        let source = |_| {
            let number = reader.varint("a source")?;
            ShSource::from_number(number).ok_or_else(|| CodecError::invalid(SECTION, "a source", number, "0 to 6"))
        };
        let sources = (0..network.inputs.len()).map(source).collect::<Result<_, _>>()?;
        Ok(ShPrior { network, sources })
    };
    (0..count as usize).map(read).collect()
}

/// The beginning of a section: its head, and its priors without weights where it has some.
fn read_beginning(reader: &mut Reader<'_>, kind: Kind, limits: &Limits) -> Result<(Head, Vec<ShPrior>), CodecError> {
    let head = Head::read(reader, limits)?;
    if kind != Kind::ShNetworks {
        return Ok((head, Vec::new()));
    }
    reader.f32("step")?;
    Ok((head, read_priors(reader, limits)?))
}

/// Whether decoding needs the feature planes.
pub(crate) fn reads_feature_planes(bytes: &[u8], kind: Kind, limits: &Limits) -> Result<bool, CodecError> {
    let (_, priors) = read_beginning(&mut Reader::new(SECTION, bytes), kind, limits)?;
    Ok(priors.iter().any(|prior| prior.sources.contains(&ShSource::SpaceFeatures)))
}

/// What the beginning of a section promises.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Promise {
    /// Coefficients of all Gaussians.
    pub(crate) values: u64,
    /// Frequency tables.
    pub(crate) tables: u64,
    /// Weights of the networks.
    pub(crate) weights: u64,
}

/// Reads what the beginning of a section promises.
pub(crate) fn promise(reader: &mut Reader<'_>, kind: Kind, limits: &Limits) -> Result<Promise, CodecError> {
    let (head, priors) = read_beginning(reader, kind, limits)?;
    let tables = if kind == Kind::ShTables { 3 * sh_rest_coefficients(head.degree) as u64 } else { 0 };
    let weights = priors.iter().fold(0_u64, |sum, prior| sum.saturating_add(prior.network.weights()));
    Ok(Promise { values: head.values(), tables, weights })
}

/// What [`write`] and [`write_continued`] have written.
#[derive(Debug)]
pub(crate) struct Written {
    /// `sh_rest` as a decoder gets it.
    pub(crate) values: Vec<f32>,
    pub(crate) bytes: ShBytes,
}

/// Writes `sh_rest` of Gaussians in their final order. Returns the coding as a decoder gets it, too: that of the layers that
/// follow.
pub(crate) fn write(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    precision: Option<WeightPrecision>,
    conditions: Conditions<'_>,
    limits: &Limits,
    writer: &mut Writer,
) -> Result<(Written, ShCoding), CodecError> {
    coding.check(gaussians.sh_degree, conditions.features(), limits)?;
    let start = writer.bytes.len();
    Head::of(gaussians).write(writer);
    let coding = coding.write(precision, writer)?;
    Ok((write_streams(gaussians, &coding, conditions, start, writer)?, coding))
}

/// Writes `sh_rest` of a layer after the first, under the tables or networks that [`write`] has returned for the first
/// one.
pub(crate) fn write_continued(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    conditions: Conditions<'_>,
    writer: &mut Writer,
) -> Result<Written, CodecError> {
    let start = writer.bytes.len();
    Head::of(gaussians).write(writer);
    write_streams(gaussians, coding, conditions, start, writer)
}

/// Writes the sub-streams and their lengths into a section that begins at `start`.
fn write_streams(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    conditions: Conditions<'_>,
    start: usize,
    writer: &mut Writer,
) -> Result<Written, CodecError> {
    let (degree, step) = (gaussians.sh_degree, coding.step());
    let mut values = gaussians.sh_rest.clone();
    let streams = match HarmonicsModel::new(coding, conditions) {
        None => channels::write(conditions.gaussians, step, degree, &mut values),
        Some(mut model) => {
            let mut writers: Vec<SymbolWriter> = (0..degree).map(|_| SymbolWriter::default()).collect();
            walk(&mut model, step, degree, &mut values, &mut writers)
                .map(|()| writers.iter().map(|writer| writer.finish(model.distributions())).collect())
        }
    };
    let streams = streams.map_err(|Damaged| {
        let found = format!("more than 4194304 steps of {step}");
        CodecError::invalid(SECTION, "a value of sh_rest", found, "fewer; make the step larger")
    })?;
    streams.iter().for_each(|stream| writer.varint(stream.len() as u64));
    let model = (writer.bytes.len() - start) as u64;
    streams.iter().for_each(|stream| writer.bytes.extend_from_slice(stream));
    let bytes = ShBytes { model, degrees: streams.iter().map(|stream| stream.len() as u64).collect() };
    Ok(Written { values, bytes })
}

impl ShBytes {
    /// Adds those of another layer.
    pub(crate) fn add(&mut self, other: &Self) {
        self.model += other.model;
        self.degrees.resize(self.degrees.len().max(other.degrees.len()), 0);
        self.degrees.iter_mut().zip(&other.degrees).for_each(|(sum, bytes)| *sum += bytes);
    }
}

/// The tables or networks of a layer, for those that continue it.
#[derive(Debug)]
pub(crate) struct FirstCoding {
    degree: u8,
    pub(crate) coding: ShCoding,
}

/// The head of a section, its coding, and the bytes of its numbers.
#[derive(Debug)]
pub(crate) struct Parts<'a> {
    pub(crate) head: Head,
    kind: Kind,
    /// None where numbers are float32, and where the coding is that of the first layer.
    coding: Option<ShCoding>,
    rest: Reader<'a>,
}

impl<'a> Parts<'a> {
    /// Reads head and coding. `features` is the length of a feature of the planes.
    pub(crate) fn read(
        bytes: &'a [u8],
        (kind, encoding): (Kind, Encoding),
        features: u64,
        budget: &Budget,
    ) -> Result<Self, CodecError> {
        let limits = &budget.limits;
        let mut rest = Reader::new(SECTION, bytes);
        let head = Head::read(&mut rest, limits)?;
        match kind {
            Kind::ShExplicit => budget.things(SECTION, bytes.len() as u64, 1, 1)?,
            _ => budget.stream(SECTION, bytes.len())?,
        }
        let coding = match kind {
            Kind::ShExplicit | Kind::ShContinued => None,
            _ => {
                let coding = ShCoding::read(&mut rest, (kind, encoding), head.degree, features, budget)?;
                coding.check(head.degree, features, limits)?;
                Some(coding)
            }
        };
        Ok(Self { head, kind, coding, rest })
    }

    /// The coding, for the layers that continue this one.
    pub(crate) fn into_coding(self) -> Option<FirstCoding> {
        self.coding.map(|coding| FirstCoding { degree: self.head.degree, coding })
    }

    /// The coefficients of the decoded Gaussians of the section. One that continues another needs the `first` coding.
    pub(crate) fn values(
        &self,
        first: Option<&FirstCoding>,
        conditions: Conditions<'_>,
        budget: &Budget,
    ) -> Result<Vec<f32>, CodecError> {
        let (head, mut reader) = (self.head, self.rest.clone());
        if head.count as usize != conditions.gaussians.len() {
            let expected = format!("{}, the number of Gaussians", conditions.gaussians.len());
            return Err(CodecError::invalid(SECTION, "count", head.count, expected));
        }
        if self.kind == Kind::ShExplicit {
            let values = reader.f32s("sh_rest", head.values())?;
            reader.finish()?;
            return Ok(values);
        }
        let of_the_first = || first.filter(|first| first.degree == head.degree).map(|first| &first.coding);
        let Some(coding) = self.coding.as_ref().or_else(of_the_first) else {
            let expected = "that of a first layer of the same degree, with tables or networks";
            return Err(CodecError::invalid(SECTION, "coding", self.kind.name(), expected));
        };
        if let ShCoding::Channels { .. } = coding {
            attributes::ask_for_channels(SECTION, head.count.into(), head.values(), budget)?;
        } else {
            budget.things(SECTION, head.values(), 4, READ_NANOSECONDS)?;
        }
        if let ShCoding::Networks { priors, .. } = coding {
            let programs = priors.iter().fold(0u64, |sum, prior| sum.saturating_add(prior.network.program_bytes()));
            budget.things(SECTION, programs, 1, 2)?;
        }

        let lengths =
            (0..head.degree).map(|_| reader.varint("length of a sub-stream")).collect::<Result<Vec<_>, _>>()?;
        let damaged = |Damaged| CodecError::invalid(SECTION, "symbols", "damaged", "symbols as an encoder writes them");
        let streams: Vec<&[u8]> =
            lengths.into_iter().map(|length| reader.take("sub-stream", length)).collect::<Result<_, _>>()?;
        reader.finish()?;
        let Some(mut model) = HarmonicsModel::new(coding, conditions) else {
            return channels::read(conditions.gaussians, coding.step(), &streams).map_err(damaged);
        };
        let mut readers = streams.into_iter().map(SymbolReader::new).collect::<Result<Vec<_>, _>>().map_err(damaged)?;
        budget.time(SECTION, model.nanoseconds().saturating_mul(u64::from(head.count).div_ceil(LANES as u64)))?;
        let mut values = vec![0.0; head.values() as usize];
        walk(&mut model, coding.step(), head.degree, &mut values, &mut readers).map_err(damaged)?;
        readers.into_iter().try_for_each(SymbolReader::finish).map_err(damaged)?;
        Ok(values)
    }
}

/// Scales and means of decoded harmonics.
pub(crate) fn distributions(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    conditions: Conditions<'_>,
    limits: &Limits,
) -> Result<Distributions, CodecError> {
    coding.check(gaussians.sh_degree, conditions.features(), limits)?;
    let Some(HarmonicsModel::Networks(mut networks)) = HarmonicsModel::new(coding, conditions) else {
        return Err(CodecError::invalid(SECTION, "coding", coding.kind().name(), "networks"));
    };
    let (values, channels) = (&gaussians.sh_rest, 3 * sh_rest_coefficients(gaussians.sh_degree));
    let mut all = Distributions { scales: vec![0.0; values.len()], means: vec![0.0; values.len()] };
    for first in (0..gaussians.len()).step_by(LANES) {
        networks.begin(first);
        for prior in 0..networks.len() {
            let (start, scales, means) = networks.parameters(prior, first, values, channels);
            for (channel, (scales, means)) in (start..).zip(scales.iter().zip(means)) {
                for lane in 0..LANES.min(gaussians.len() - first) {
                    let at = (first + lane) * channels + channel;
                    (all.scales[at], all.means[at]) = (scales[lane], bounded_mean(means[lane]));
                }
            }
        }
    }
    Ok(all)
}
