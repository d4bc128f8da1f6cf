//! The context model of the hexplanes as data (paper III-C, docs/design.md).

use crate::{
    CodecError, FrequencyTable, Limits, Network, PerGroup,
    limits::at_most,
    plane_layout::{PLANE_NAMES, PLANES_PER_SCALE},
};

pub(super) const SECTION: &str = "context_model";

/// Everything that is needed to read planes: the networks that give each value's distribution, and which of them speak
/// for which plane.
///
/// Each plane has a [`PlanePrior`]. Its conditions read what is known before the plane itself, and its distribution turns
/// what they say into the scale and the mean of every value. Planes enter a network as value minus center.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContextModelArrays {
    /// Channels `M` of a plane.
    pub channels: u32,
    /// What is subtracted from a plane before any network sees it.
    pub centers: PerGroup,
    /// The latent of the planes that have one.
    pub latent: Option<LatentArrays>,
    /// The networks. Conditions and distributions are places in this list.
    pub networks: Vec<Network>,
    /// The priors that there are. [`ContextModelArrays::lowest`] and [`ContextModelArrays::higher`] are places in this list.
    pub priors: Vec<PlanePrior>,
    /// The prior of each plane of the lowest scale, in the order of [`crate::plane_layout::PLANE_NAMES`].
    pub lowest: [u32; PLANES_PER_SCALE],
    /// The prior of each plane of the higher scales.
    pub higher: [u32; PLANES_PER_SCALE],
}

/// A latent that is transmitted for a plane: `N` channels of a quarter of the plane's height and width.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LatentArrays {
    /// The distribution of the symbols of each channel.
    pub tables: Vec<FrequencyTable>,
    /// The median of each channel: a value of the latent is symbol plus median.
    pub medians: Vec<f32>,
}

/// Where the distributions of a plane's values come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlanePrior {
    /// One for each input of the distribution; nothing where that input is zeros.
    pub conditions: Vec<Option<Condition>>,
    /// The network that gives scales and means, `2 M` channels, in units of the step, from what the conditions say at the
    /// same place.
    pub distribution: u32,
}

/// A network that says something about a plane, and what it reads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// The network, which has one output, of the plane's size.
    pub network: u32,
    /// What its inputs are.
    pub sources: Vec<PlaneSource>,
}

/// What the network of a [`Condition`] may read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneSource {
    /// The plane's latent, `[N, H / 4, W / 4]`.
    Latent,
    /// The plane's own anchors: the values at places whose row and column have an odd sum. A plane with such a condition
    /// is coded in two passes, the anchors first; for them the condition says zeros.
    Anchors,
    /// The decoded plane at this position of [`crate::plane_layout::PLANE_NAMES`] in the same scale.
    SameScale(u8),
    /// The decoded plane over the same axes one scale below.
    LowerScale,
}

impl PlanePrior {
    pub(crate) fn has_latent(&self) -> bool {
        self.sources().any(|source| source == PlaneSource::Latent)
    }

    /// Whether anchors come first, in a sub-stream of their own.
    pub(crate) fn has_anchors(&self) -> bool {
        self.sources().any(|source| source == PlaneSource::Anchors)
    }

    pub(crate) fn sources(&self) -> impl Iterator<Item = PlaneSource> {
        self.conditions.iter().flatten().flat_map(|condition| condition.sources.iter().copied())
    }
}

impl ContextModelArrays {
    /// Channels of the latent, 0 without one.
    pub fn latent_channels(&self) -> u32 {
        self.latent.as_ref().map_or(0, |latent| latent.medians.len() as u32)
    }

    /// The prior of a plane, counted scale by scale.
    ///
    /// # Panics
    /// Where a plane's prior is not in [`ContextModelArrays::priors`].
    pub fn prior(&self, plane: usize) -> &PlanePrior {
        let (scale, position) = (plane / PLANES_PER_SCALE, plane % PLANES_PER_SCALE);
        let priors = if scale == 0 { &self.lowest } else { &self.higher };
        &self.priors[priors[position] as usize]
    }

    /// Whether each plane of a hexplane with some number of scales has a latent.
    ///
    /// # Panics
    /// As [`ContextModelArrays::prior`].
    pub fn have_latents(&self, scales: usize) -> Vec<bool> {
        (0..PLANES_PER_SCALE * scales).map(|plane| self.prior(plane).has_latent()).collect()
    }

    /// Refuses arrays that make no context model, or one beyond the limits.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        self.check_structure(limits)?;
        for (index, network) in self.networks.iter().enumerate() {
            network.check(SECTION, &network_name(index), limits)?;
        }
        if let Some(LatentArrays { tables, medians }) = &self.latent {
            if tables.len() != medians.len() || tables.is_empty() {
                let found = format!("{} tables, {} medians", tables.len(), medians.len());
                return invalid("latent", found, "one of each a channel, and 1 channel or more");
            }
            if let Some(index) = medians.iter().position(|median| !median.is_finite()) {
                let (field, value) = ("medians of the latent".into(), medians[index]);
                return Err(CodecError::NonFinite { section: SECTION, field, index, value });
            }
        }
        Ok(())
    }

    /// [`ContextModelArrays::check`] without a look at the weights.
    pub(crate) fn check_structure(&self, limits: &Limits) -> Result<(), CodecError> {
        for (name, center) in [("space-only", self.centers.space_only), ("space-time", self.centers.space_time)] {
            if !center.is_finite() {
                return invalid(&format!("center of {name} planes"), center, "a finite number");
            }
        }
        at_most(SECTION, "channels", self.channels.into(), limits.channels)?;
        at_most(SECTION, "channels of the latent", self.latent_channels().into(), limits.channels)?;
        at_most(SECTION, "number of networks", self.networks.len() as u64, limits.networks)?;
        at_most(SECTION, "number of priors", self.priors.len() as u64, limits.networks)?;
        let mut weights = 0u64;
        for (index, network) in self.networks.iter().enumerate() {
            network.check_structure(SECTION, &network_name(index), limits)?;
            weights = weights.saturating_add(network.weights());
        }
        at_most(SECTION, "number of weights", weights, limits.layer_weights)?;
        for (index, prior) in self.priors.iter().enumerate() {
            self.check_prior(&format!("priors[{index}]"), prior, limits)?;
        }
        for (scales, priors) in [("lowest", &self.lowest), ("higher", &self.higher)] {
            for (position, &prior) in priors.iter().enumerate() {
                if prior as usize >= self.priors.len() {
                    let field = format!("prior of {} ({scales} scales)", PLANE_NAMES[position]);
                    return invalid(&field, prior, &format!("less than {}", self.priors.len()));
                }
            }
            levels(&priors.map(|prior| &self.priors[prior as usize]))?;
        }
        let below =
            |&prior: &u32| self.priors[prior as usize].sources().any(|source| source == PlaneSource::LowerScale);
        if let Some(position) = self.lowest.iter().position(below) {
            let field = format!("a source of {} (lowest scale)", PLANE_NAMES[position]);
            return invalid(&field, "the scale below", "something that is there");
        }
        Ok(())
    }

    fn network(&self, name: &str, index: u32) -> Result<&Network, CodecError> {
        self.networks.get(index as usize).ok_or_else(|| {
            CodecError::invalid(
                SECTION,
                format!("network of {name}"),
                index,
                format!("less than {}", self.networks.len()),
            )
        })
    }

    fn check_prior(&self, name: &str, prior: &PlanePrior, limits: &Limits) -> Result<(), CodecError> {
        let distribution = self.network(name, prior.distribution)?;
        let distribution_name = network_name(prior.distribution as usize);
        distribution.check_pointwise(SECTION, &distribution_name)?;
        distribution.check_outputs(SECTION, &distribution_name, &[2 * u64::from(self.channels)])?;
        if prior.conditions.len() != distribution.inputs.len() {
            let expected = format!("{}, one for each input of {distribution_name}", distribution.inputs.len());
            return invalid(&format!("number of conditions of {name}"), prior.conditions.len(), &expected);
        }
        for (condition, &channels) in prior.conditions.iter().zip(&distribution.inputs) {
            let Some(Condition { network, sources }) = condition else { continue };
            at_most(SECTION, format!("number of sources in {name}"), sources.len() as u64, limits.nodes)?;
            let (network, network_name) = (self.network(name, *network)?, network_name(*network as usize));
            network.check_outputs(SECTION, &network_name, &[channels.into()])?;
            if sources.len() != network.inputs.len() {
                let expected = format!("{}, one for each input of {network_name}", network.inputs.len());
                return invalid(&format!("number of sources in {name}"), sources.len(), &expected);
            }
            for ((&source, &channels), anchors) in sources.iter().zip(&network.inputs).zip(network.anchor_inputs()) {
                if anchors != (source == PlaneSource::Anchors) {
                    let found = format!("{source:?}");
                    let expected = if anchors { "anchors, which a checkerboard reads" } else { "no anchors" };
                    return invalid(&format!("a source in {name}"), found, expected);
                }
                let expected = match source {
                    PlaneSource::Latent => self.latent_channels(),
                    PlaneSource::SameScale(position) if usize::from(position) >= PLANES_PER_SCALE => {
                        return invalid(&format!("a source in {name}"), format!("plane {position}"), "less than 6");
                    }
                    _ => self.channels,
                };
                if channels != expected || expected == 0 {
                    let field = format!("channels of an input of {network_name}");
                    return invalid(&field, channels, &format!("{expected}, those of its source {source:?}"));
                }
            }
        }
        Ok(())
    }
}

/// In which round each plane of a scale can be coded: a plane comes after those that it reads. Refuses planes that wait
/// for each other.
pub(super) fn levels(priors: &[&PlanePrior; PLANES_PER_SCALE]) -> Result<[usize; PLANES_PER_SCALE], CodecError> {
    let mut levels = [None; PLANES_PER_SCALE];
    for level in 0..PLANES_PER_SCALE {
        let before = levels;
        for (position, prior) in priors.iter().enumerate() {
            let ready = prior.sources().all(|source| match source {
                PlaneSource::SameScale(other) => before.get(usize::from(other)).is_some_and(|level| level.is_some()),
                _ => true,
            });
            if ready && levels[position].is_none() {
                levels[position] = Some(level);
            }
        }
    }
    if let Some(position) = levels.iter().position(Option::is_none) {
        let field = format!("sources of {}", PLANE_NAMES[position]);
        let found = "planes that wait for this one";
        return Err(CodecError::invalid(SECTION, field, found, "planes that can be decoded before it"));
    }
    Ok(levels.map(|level| level.unwrap_or(0)))
}

pub(super) fn network_name(index: usize) -> String {
    format!("networks[{index}]")
}

fn invalid(field: &str, found: impl ToString, expected: &str) -> Result<(), CodecError> {
    Err(CodecError::invalid(SECTION, field, found, expected))
}
