//! The context model of the planes as data (paper III-C, docs/design.md).

use crate::{
    CodecError, FrequencyTable, Limits, Network, PerGroup,
    limits::at_most,
    plane_layout::{PlaneAxes, PlaneLayout},
};

pub(super) const SECTION: &str = "context_model";

/// Everything that is needed to decode planes: the networks that give each value's distribution, and the planes of each
/// network.
///
/// Each plane has a [`PlanePrior`]. Its conditions read values that are decoded before, and its distribution turns
/// their outputs into the scale and the mean of every value. As inputs of networks, planes have their center
/// subtracted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContextModelArrays {
    /// Channels `M` of a plane.
    pub channels: u32,
    /// The center: it is subtracted from a plane before a network reads it.
    pub centers: PerGroup,
    /// The latent of the planes that have one.
    pub latent: Option<LatentArrays>,
    /// The networks. Conditions and distributions are indices into this list.
    pub networks: Vec<Network>,
    /// The priors. [`ContextModelArrays::plane_priors`] are indices into this list.
    pub priors: Vec<PlanePrior>,
    /// The prior of each plane, in the order of the planes.
    pub plane_priors: Vec<u32>,
}

/// A latent that is coded for a plane: `N` channels of a quarter of the plane's height and width.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LatentArrays {
    /// The distribution of the symbols of each channel.
    pub tables: Vec<FrequencyTable>,
    /// The median of each channel: a value of the latent is symbol plus median.
    pub medians: Vec<f32>,
}

/// The networks that give the distributions of a plane's values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlanePrior {
    /// One for each input of the distribution; `None` where that input is zeros.
    pub conditions: Vec<Option<Condition>>,
    /// The network that gives scales and means, `2 M` channels, in units of the step, from the outputs of the
    /// conditions at the same place.
    pub distribution: u32,
}

/// A network that describes a plane, and the sources of its inputs.
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
    /// The plane's own anchors: the values at places whose row and column have an odd sum. A plane with such a
    /// condition is coded in two passes, the anchors first. For the anchors themselves, the output of the condition is
    /// zeros.
    Anchors,
    /// The decoded plane over these axes in the same scale.
    SameScale(PlaneAxes),
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

    /// The prior of a plane, by the plane's index.
    ///
    /// # Panics
    /// If a plane's prior is not in [`ContextModelArrays::priors`].
    pub fn prior(&self, plane: usize) -> &PlanePrior {
        &self.priors[self.plane_priors[plane] as usize]
    }

    /// Whether each plane has a latent.
    ///
    /// # Panics
    /// As [`ContextModelArrays::prior`].
    pub fn have_latents(&self) -> Vec<bool> {
        (0..self.plane_priors.len()).map(|plane| self.prior(plane).has_latent()).collect()
    }

    /// Its description: the same without weights, and of the latent only its number of channels.
    pub(crate) fn into_description(self) -> Self {
        let latent =
            self.latent.map(|latent| LatentArrays { tables: Vec::new(), medians: vec![0.0; latent.medians.len()] });
        Self { latent, networks: self.networks.into_iter().map(Network::without_weights).collect(), ..self }
    }

    /// Refuses an illegal context model, or one beyond the limits.
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

    /// [`ContextModelArrays::check`] without the weights.
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
        at_most(SECTION, "number of planes", self.plane_priors.len() as u64, limits.planes())?;
        for (plane, &prior) in self.plane_priors.iter().enumerate() {
            if prior as usize >= self.priors.len() {
                let field = format!("prior of planes[{plane}]");
                return invalid(&field, prior, &format!("less than {}", self.priors.len()));
            }
        }
        Ok(())
    }

    /// Refuses a legal model that does not fit these planes: it has another number of planes, its sources do not exist,
    /// or its planes depend on each other in a circle.
    pub(crate) fn check_planes(&self, layout: &PlaneLayout) -> Result<(), CodecError> {
        if self.plane_priors.len() != layout.len() {
            let expected = format!("{}, one for each plane", layout.len());
            return invalid("number of planes with a prior", self.plane_priors.len(), &expected);
        }
        for (plane, shape) in layout.planes().iter().enumerate() {
            for source in self.prior(plane).sources() {
                let missing = match source {
                    PlaneSource::SameScale(axes) if layout.in_same_scale(plane, axes).is_none() => axes.name(),
                    PlaneSource::LowerScale if layout.one_scale_below(plane).is_none() => "the scale below",
                    _ => continue,
                };
                return invalid(&format!("a source of plane {}", shape.name()), missing, "a plane that exists");
            }
        }
        (0..layout.scales()).try_for_each(|scale| levels(self, layout, scale).map(drop))
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

/// The round in which each plane of a scale can be coded: a plane comes after those that it reads. Refuses planes that
/// depend on each other in a circle. The planes' sources must exist.
pub(super) fn levels(model: &ContextModelArrays, layout: &PlaneLayout, scale: usize) -> Result<Vec<usize>, CodecError> {
    let planes = layout.scale(scale);
    let first = planes.start;
    let mut levels = vec![None; planes.len()];
    for level in 0..planes.len() {
        let before = levels.clone();
        for plane in planes.clone() {
            let ready = model.prior(plane).sources().all(|source| match source {
                PlaneSource::SameScale(axes) => {
                    layout.in_same_scale(plane, axes).is_some_and(|other| before[other - first].is_some())
                }
                _ => true,
            });
            if ready && levels[plane - first].is_none() {
                levels[plane - first] = Some(level);
            }
        }
    }
    if let Some(place) = levels.iter().position(Option::is_none) {
        let field = format!("sources of plane {}", layout.planes()[first + place].name());
        let found = "planes that depend on this one";
        return Err(CodecError::invalid(SECTION, field, found, "planes that can be decoded before it"));
    }
    Ok(levels.into_iter().flatten().collect())
}

pub(super) fn network_name(index: usize) -> String {
    format!("networks[{index}]")
}

fn invalid(field: &str, found: impl ToString, expected: &str) -> Result<(), CodecError> {
    Err(CodecError::invalid(SECTION, field, found, expected))
}
