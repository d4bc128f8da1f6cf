//! A stream whose sections are decoded one at a time.

use super::{
    check,
    container::{Container, Header},
    info::StreamInfo,
    layers::LayerHeads,
    scene_coordinates,
};
use crate::{
    CodecError, FeaturePlaneArrays, GaussianArrays, Limits, MotionArrays, SceneCoordinateArrays, SceneData, SceneMeta,
    attributes,
    budget::{Budget, Demand},
    bytes::{Reader, Section, sections::Kind},
    motion, parallel, planes,
    sh::{self, coding::Conditions, section::FirstCoding},
};

/// A stream whose header has been checked and whose sections are decoded one by one, on request.
///
/// For programs that need a part of a scene, or want to know how long each part takes; [`crate::decode`] decodes all of
/// it.
///
/// ```
/// use light4gs_codec::{OpenStream, SceneData, encode};
/// let bytes = encode(&SceneData::default())?;
/// let stream = OpenStream::new(&bytes)?;
/// assert!(stream.gaussians()?.is_empty());
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Clone, Debug)]
pub struct OpenStream<'a> {
    pub(super) container: Container<'a>,
    limits: Limits,
}

/// A whole stream, read once.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The scene.
    pub scene: SceneData,
    /// What [`crate::info`] says of the stream.
    pub info: StreamInfo,
    /// What a reader must allow.
    pub demand: Demand,
}

impl<'a> OpenStream<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// A header that is damaged, or that of a newer version.
    pub fn new(bytes: &'a [u8]) -> Result<Self, CodecError> {
        Self::with_limits(bytes, &Limits::default())
    }

    /// As [`OpenStream::new`], within limits of the caller.
    ///
    /// # Errors
    /// As [`OpenStream::new`].
    pub fn with_limits(bytes: &'a [u8], limits: &Limits) -> Result<Self, CodecError> {
        Ok(Self { container: Container::read(bytes, limits)?, limits: limits.for_stream(bytes.len()) })
    }

    /// The beginning of a stream whose sections, as far as they are there, have been checked against their checksums.
    pub(crate) fn beginning(bytes: &'a [u8], header: &'a Header, limits: Limits) -> Self {
        Self { container: Container::beginning(bytes, header), limits }
    }

    /// A budget for one call.
    fn budget(&self) -> Budget {
        Budget::new(&self.limits)
    }

    /// The scene meta.
    pub fn meta(&self) -> &SceneMeta {
        &self.container.header.meta
    }

    /// The Gaussians without `sh_degree` and `sh_rest`.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn gaussians(&self) -> Result<GaussianArrays, CodecError> {
        self.gaussians_within(&self.budget())
    }

    fn gaussians_within(&self, budget: &Budget) -> Result<GaussianArrays, CodecError> {
        self.heads()?;
        concatenated(self.gaussian_layers_within(budget)?, budget)
    }

    /// The Gaussians of every layer, without their harmonics. [`OpenStream::heads`] has accepted the heads.
    fn gaussian_layers_within(&self, budget: &Budget) -> Result<Vec<GaussianArrays>, CodecError> {
        parallel::map(self.layers().max(1), |layer| self.layer_of_gaussians_within(layer, budget)).into_iter().collect()
    }

    pub(crate) fn layer_of_gaussians_within(
        &self,
        layer: usize,
        budget: &Budget,
    ) -> Result<GaussianArrays, CodecError> {
        let (_, encoding, payload) = self.container.layer(Section::Gaussians, layer)?;
        attributes::decode_within(payload, encoding, budget)
    }

    /// Number of layers of Gaussians: 1, unless the encoder was asked for more.
    pub fn layers(&self) -> usize {
        self.container.header.layers()
    }

    /// The same stream, with the checksums of all sections checked, so that none is computed twice.
    pub(super) fn verified(&self) -> Result<OpenStream<'_>, CodecError> {
        Ok(OpenStream { container: self.container.verified()?, limits: self.limits })
    }

    /// The heads of all layers.
    pub(super) fn heads(&self) -> Result<LayerHeads, CodecError> {
        let mut heads = LayerHeads::default();
        for layer in 0..self.layers().max(1) {
            self.add_heads(layer, &mut heads)?;
        }
        Ok(heads)
    }

    /// Adds the heads of a layer to those of the layers before.
    pub(crate) fn add_heads(&self, layer: usize, heads: &mut LayerHeads) -> Result<(), CodecError> {
        let (_, encoding, payload) = self.container.layer(Section::Gaussians, layer)?;
        let gaussians =
            attributes::Head::read(&mut Reader::new(Section::Gaussians.name(), payload), encoding, &self.limits)?;
        let (_, _, payload) = self.container.layer(Section::Sh, layer)?;
        let sh = sh::section::Head::read(&mut Reader::new(Section::Sh.name(), payload), &self.limits)?;
        heads.add(gaussians, sh, self.limits.gaussians)
    }

    /// The scene coordinates.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn coordinates(&self) -> Result<SceneCoordinateArrays, CodecError> {
        let (kind, _, payload) = self.container.section(Section::SceneCoordinates)?;
        scene_coordinates::read(payload, kind)
    }

    /// How the Gaussians move.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn motion(&self) -> Result<MotionArrays, CodecError> {
        self.motion_within(&self.budget())
    }

    fn motion_within(&self, budget: &Budget) -> Result<MotionArrays, CodecError> {
        let (_, encoding, payload) = self.container.section(Section::Motion)?;
        motion::section::read(payload, encoding, budget)
    }

    /// The planes.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn feature_planes(&self) -> Result<FeaturePlaneArrays, CodecError> {
        Ok(self.feature_planes_within(&self.budget())?.0)
    }

    fn feature_planes_within(&self, budget: &Budget) -> Result<(FeaturePlaneArrays, planes::Summary), CodecError> {
        let (kind, _, payload) = self.container.section(Section::FeaturePlanes)?;
        if kind == Kind::FeaturePlanesExplicit {
            let planes = planes::explicit::read(payload, budget)?;
            let summary = planes::Summary::of_explicit(&planes)?;
            return Ok((planes, summary));
        }
        let (_, encoding, model) = self.container.section(Section::ContextModel)?;
        let model = planes::context_section::read(model, encoding, budget)?;
        planes::section::read(payload, model, budget)
    }

    /// Whether [`OpenStream::sh`] needs the planes.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn sh_needs_feature_planes(&self) -> Result<bool, CodecError> {
        let (kind, _, payload) = self.container.section(Section::Sh)?;
        sh::section::reads_feature_planes(payload, kind, &self.limits)
    }

    /// `gaussians`, which come from this stream, completed by `sh_degree` and `sh_rest`. The planes may be empty if
    /// [`OpenStream::sh_needs_feature_planes`] is false.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn sh(
        &self,
        gaussians: GaussianArrays,
        coordinates: &SceneCoordinateArrays,
        feature_planes: &FeaturePlaneArrays,
    ) -> Result<GaussianArrays, CodecError> {
        self.sh_within(gaussians, coordinates, feature_planes, &self.budget())
    }

    fn sh_within(
        &self,
        gaussians: GaussianArrays,
        coordinates: &SceneCoordinateArrays,
        feature_planes: &FeaturePlaneArrays,
        budget: &Budget,
    ) -> Result<GaussianArrays, CodecError> {
        let layers = match self.layers() {
            0 | 1 => vec![gaussians],
            _ => {
                let gaussians = GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..gaussians };
                split(&gaussians, &self.heads()?.counts)
            }
        };
        concatenated(self.sh_of_layers_within(layers, coordinates, feature_planes, budget)?, budget)
    }

    /// Layers of Gaussians, at least one, completed by their harmonics.
    fn sh_of_layers_within(
        &self,
        layers: Vec<GaussianArrays>,
        coordinates: &SceneCoordinateArrays,
        feature_planes: &FeaturePlaneArrays,
        budget: &Budget,
    ) -> Result<Vec<GaussianArrays>, CodecError> {
        let of_layer = |layer: usize, first: Option<&FirstCoding>| {
            self.sh_of_layer_within(layer, &layers[layer], first, (coordinates, feature_planes), budget)
        };
        let Harmonics { degree, rest, coding } = of_layer(0, None)?;
        let further = parallel::map(layers.len() - 1, |at| of_layer(at + 1, coding.as_ref()).map(|layer| layer.rest));
        let rests = std::iter::once(Ok(rest)).chain(further);
        let complete = |(gaussians, rest): (GaussianArrays, Result<Vec<f32>, CodecError>)| {
            Ok(GaussianArrays { sh_degree: degree, sh_rest: rest?, ..gaussians })
        };
        layers.into_iter().zip(rests).map(complete).collect()
    }

    /// The harmonics of a layer. Where they continue those of the first layer, its coding is needed.
    pub(crate) fn sh_of_layer_within(
        &self,
        layer: usize,
        gaussians: &GaussianArrays,
        first: Option<&FirstCoding>,
        (coordinates, feature_planes): (&SceneCoordinateArrays, &FeaturePlaneArrays),
        budget: &Budget,
    ) -> Result<Harmonics, CodecError> {
        let (kind, encoding, payload) = self.container.layer(Section::Sh, layer)?;
        let conditions = Conditions { gaussians, coordinates, feature_planes };
        let parts = sh::section::Parts::read(payload, (kind, encoding), feature_planes.features(), budget)?;
        let rest = parts.values(first, conditions, budget)?;
        Ok(Harmonics { degree: parts.head.degree, rest, coding: parts.into_coding() })
    }

    /// The whole scene, and all that the stream says of it. Sections that do not depend on each other are decoded at the same
    /// time where there are threads.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn decode(&self) -> Result<Decoded, CodecError> {
        self.verified()?.decode_verified()
    }

    fn decode_verified(&self) -> Result<Decoded, CodecError> {
        let budget = self.budget();
        self.check_sections()?;
        let coordinates = self.coordinates()?;
        let coupled = self.sh_needs_feature_planes()?;
        let (gaussians, feature_planes) = parallel::join(
            || {
                let heads = self.heads()?;
                let layers = self.gaussian_layers_within(&budget)?;
                if coupled {
                    return Ok((heads, layers));
                }
                let planes = FeaturePlaneArrays::default();
                Ok((heads, self.sh_of_layers_within(layers, &coordinates, &planes, &budget)?))
            },
            || self.feature_planes_within(&budget),
        );
        let ((heads, mut layers), (feature_planes, planes)) = (gaussians?, feature_planes?);
        if coupled {
            layers = self.sh_of_layers_within(layers, &coordinates, &feature_planes, &budget)?;
        }
        let gaussians = concatenated(layers, &budget)?;
        let motion = self.motion_within(&budget)?;
        let info = StreamInfo::new(&self.container.header, heads, planes, motion.description());
        let scene = SceneData { meta: info.meta.clone(), gaussians, coordinates, feature_planes, motion };
        check(&scene, &self.limits)?;
        Ok(Decoded { scene, info, demand: budget.demand() })
    }

    /// The scene without its Gaussians: what all layers share.
    pub(crate) fn shared_within(&self, budget: &Budget) -> Result<SceneData, CodecError> {
        self.check_sections()?;
        Ok(SceneData {
            meta: self.meta().clone(),
            gaussians: GaussianArrays::default(),
            coordinates: self.coordinates()?,
            feature_planes: self.feature_planes_within(budget)?.0,
            motion: self.motion_within(budget)?,
        })
    }

    /// Refuses a context model without coded planes, and coded planes without a context model.
    pub(super) fn check_sections(&self) -> Result<(), CodecError> {
        let coded = self.container.section(Section::FeaturePlanes)?.0 == Kind::FeaturePlanesContextCoded;
        if self.container.header.has(Section::ContextModel) && !coded {
            let section = Section::ContextModel.name();
            return Err(CodecError::invalid(section, "section", "there", "none, since no plane is coded with it"));
        }
        Ok(())
    }
}

/// The decoded harmonics of a layer.
#[derive(Debug)]
pub(crate) struct Harmonics {
    pub(crate) degree: u8,
    pub(crate) rest: Vec<f32>,
    /// For layers that continue this one.
    pub(crate) coding: Option<FirstCoding>,
}

/// All layers, one after the other.
fn concatenated(layers: Vec<GaussianArrays>, budget: &Budget) -> Result<GaussianArrays, CodecError> {
    let mut layers = layers.into_iter();
    let mut all = layers.next().unwrap_or_default();
    layers.try_for_each(|layer| append_within(&mut all, layer, budget))?;
    Ok(all)
}

/// Appends a layer; for a moment its numbers are there twice.
pub(crate) fn append_within(
    gaussians: &mut GaussianArrays,
    layer: GaussianArrays,
    budget: &Budget,
) -> Result<(), CodecError> {
    budget.memory(Section::Gaussians.name(), layer.bytes())?;
    gaussians.append(layer);
    Ok(())
}

/// Gaussians in layers of these sizes; where they are too few, the last layers are too small, which is refused later.
fn split(gaussians: &GaussianArrays, counts: &[u32]) -> Vec<GaussianArrays> {
    let mut start = 0;
    let take = |&count: &u32| {
        let end = (start + count).min(gaussians.len() as u32);
        let layer = gaussians.gathered(&(start..end).collect::<Vec<_>>());
        start = end;
        layer
    };
    counts.iter().map(take).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    /// Compares the estimated time with the real one, on one thread: `LIGHT4GS_STREAMS=folder cargo test --release -p
    /// light4gs-codec --lib calibration -- --ignored --nocapture`. The estimate must be larger.
    #[test]
    #[ignore = "needs a folder of streams"]
    fn calibration() {
        let folder = std::env::var("LIGHT4GS_STREAMS").expect("a folder in LIGHT4GS_STREAMS");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let bytes = std::fs::read(&path).expect("a file");
            let stream = OpenStream::with_limits(&bytes, &Limits::large()).expect("a stream");
            let decode = || pool.install(|| (Instant::now(), stream.decode(), Instant::now()));
            let runs: Vec<_> = (0..3).map(|_| decode()).collect();
            let took = runs.iter().map(|(begin, _, end)| *end - *begin).min().expect("three runs").as_secs_f64() * 1e3;
            match &runs[0].1 {
                Ok(Decoded { scene, demand, .. }) => {
                    let (asked, mib) = (demand.nanoseconds as f64 / 1e6, demand.memory_bytes >> 20);
                    println!(
                        "{:5.2} asked {asked:7.1} ms took {took:7.1} ms, {mib} MiB, {} bytes, {} Gaussians, {} channels of {} planes: {}",
                        asked / took,
                        bytes.len(),
                        scene.gaussians.len(),
                        scene.feature_planes.channels,
                        scene.feature_planes.planes.len(),
                        path.display()
                    );
                }
                Err(error) => println!("{error}: {}", path.display()),
            }
        }
    }
}
