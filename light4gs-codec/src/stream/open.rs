//! A stream whose sections are decoded one at a time.

use super::{check, container::Container, scene_coordinates};
use crate::{
    CodecError, FeaturePlaneArrays, GaussianArrays, Limits, MotionArrays, SceneCoordinateArrays, SceneData, SceneMeta,
    attributes,
    budget::{Budget, Demand},
    bytes::{Section, sections::Kind},
    motion, parallel, planes,
    sh::{self, coding::Conditions},
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
    container: Container<'a>,
    limits: Limits,
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

    /// A budget for one call.
    fn budget(&self) -> Budget {
        Budget::new(&self.limits)
    }

    /// The scene meta.
    pub fn meta(&self) -> &SceneMeta {
        &self.container.meta
    }

    /// The Gaussians without `sh_degree` and `sh_rest`.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn gaussians(&self) -> Result<GaussianArrays, CodecError> {
        self.gaussians_within(&self.budget())
    }

    fn gaussians_within(&self, budget: &Budget) -> Result<GaussianArrays, CodecError> {
        let (_, encoding, payload) = self.container.section(Section::Gaussians)?;
        attributes::decode_within(payload, encoding, budget)
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
        self.feature_planes_within(&self.budget())
    }

    fn feature_planes_within(&self, budget: &Budget) -> Result<FeaturePlaneArrays, CodecError> {
        let (kind, _, payload) = self.container.section(Section::FeaturePlanes)?;
        if kind == Kind::FeaturePlanesExplicit {
            return planes::explicit::read(payload, budget);
        }
        let (_, encoding, model) = self.container.section(Section::ContextModel)?;
        let model = planes::context_section::read(model, encoding, budget)?;
        planes::section::read(payload, &model, budget)
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
        let (kind, encoding, payload) = self.container.section(Section::Sh)?;
        let conditions = Conditions { gaussians: &gaussians, coordinates, feature_planes };
        let (head, sh_rest) = sh::section::read(payload, (kind, encoding), conditions, budget)?;
        Ok(GaussianArrays { sh_degree: head.degree, sh_rest, ..gaussians })
    }

    /// The whole scene. Sections that do not depend on each other are decoded at the same time where there are threads.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn scene(&self) -> Result<SceneData, CodecError> {
        self.scene_and_demand().map(|(scene, _)| scene)
    }

    /// The whole scene, and its cost.
    pub(crate) fn scene_and_demand(&self) -> Result<(SceneData, Demand), CodecError> {
        let budget = self.budget();
        self.check_sections()?;
        let coordinates = self.coordinates()?;
        let coupled = self.sh_needs_feature_planes()?;
        let (gaussians, feature_planes) = parallel::join(
            || {
                let gaussians = self.gaussians_within(&budget)?;
                if coupled {
                    return Ok(gaussians);
                }
                self.sh_within(gaussians, &coordinates, &FeaturePlaneArrays::default(), &budget)
            },
            || self.feature_planes_within(&budget),
        );
        let (mut gaussians, feature_planes) = (gaussians?, feature_planes?);
        if coupled {
            gaussians = self.sh_within(gaussians, &coordinates, &feature_planes, &budget)?;
        }
        let motion = self.motion_within(&budget)?;
        let scene = SceneData { meta: self.container.meta.clone(), gaussians, coordinates, feature_planes, motion };
        check(&scene, &self.limits)?;
        Ok((scene, budget.demand()))
    }

    /// Refuses a context model without coded planes, and coded planes without a context model.
    fn check_sections(&self) -> Result<(), CodecError> {
        let coded = self.container.section(Section::FeaturePlanes)?.0 == Kind::FeaturePlanesContextCoded;
        if self.container.has(Section::ContextModel) && !coded {
            let section = Section::ContextModel.name();
            return Err(CodecError::invalid(section, "section", "there", "none, since no plane is coded with it"));
        }
        Ok(())
    }
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
            let decode = || pool.install(|| (Instant::now(), stream.scene_and_demand(), Instant::now()));
            let runs: Vec<_> = (0..3).map(|_| decode()).collect();
            let took = runs.iter().map(|(begin, _, end)| *end - *begin).min().expect("three runs").as_secs_f64() * 1e3;
            match &runs[0].1 {
                Ok((scene, demand)) => {
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
