//! A stream whose sections are decoded one at a time.

use super::{
    check,
    container::Container,
    gaussians, motion, scene_frame,
    sections::{Encoding, Kind, Section},
};
use crate::{
    CodecError, GaussianArrays, HexPlaneArrays, Limits, MotionArrays, SceneData, SceneFrameArrays, SceneMeta,
    attributes, parallel, planes,
    sh::{self, coding::Conditions},
};

/// A stream whose header is sound and whose sections are decoded when they are asked for.
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

    /// As [`OpenStream::new`], within limits of the caller's.
    ///
    /// # Errors
    /// As [`OpenStream::new`].
    pub fn with_limits(bytes: &'a [u8], limits: &Limits) -> Result<Self, CodecError> {
        Ok(Self { container: Container::read(bytes, limits)?, limits: limits.for_stream(bytes.len()) })
    }

    /// The scene meta.
    pub fn meta(&self) -> &SceneMeta {
        &self.container.meta
    }

    /// The Gaussians but for `sh_degree` and `sh_rest`.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn gaussians(&self) -> Result<GaussianArrays, CodecError> {
        match self.container.section(Section::Gaussians)? {
            (_, Encoding::Quantized, payload) => attributes::decode(payload, &self.limits),
            (_, Encoding::Float32, payload) => gaussians::read(payload, &self.limits),
        }
    }

    /// The frame.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn frame(&self) -> Result<SceneFrameArrays, CodecError> {
        let (kind, _, payload) = self.container.section(Section::SceneFrame)?;
        scene_frame::read(payload, kind)
    }

    /// How the Gaussians move.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn motion(&self) -> Result<MotionArrays, CodecError> {
        let (_, encoding, payload) = self.container.section(Section::Motion)?;
        motion::read(payload, encoding, &self.limits)
    }

    /// The planes.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn hexplanes(&self) -> Result<HexPlaneArrays, CodecError> {
        let (kind, _, payload) = self.container.section(Section::HexPlanes)?;
        if kind == Kind::HexPlanesExplicit {
            return planes::explicit::read(payload, &self.limits);
        }
        let (_, encoding, model) = self.container.section(Section::ContextModel)?;
        let model = planes::context_section::read(model, encoding, &self.limits)?;
        planes::section::read(payload, &model, &self.limits)
    }

    /// Whether [`OpenStream::sh`] looks at the planes it is given.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn sh_needs_hexplanes(&self) -> Result<bool, CodecError> {
        let (kind, _, payload) = self.container.section(Section::Sh)?;
        sh::section::reads_hexplanes(payload, kind, &self.limits)
    }

    /// `gaussians`, which come from this stream, with their `sh_degree` and `sh_rest`. The planes may be empty unless
    /// [`OpenStream::sh_needs_hexplanes`].
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn sh(
        &self,
        gaussians: GaussianArrays,
        frame: &SceneFrameArrays,
        hexplane: &HexPlaneArrays,
    ) -> Result<GaussianArrays, CodecError> {
        let (kind, encoding, payload) = self.container.section(Section::Sh)?;
        let conditions = Conditions { gaussians: &gaussians, frame, hexplane };
        let (head, sh_rest) = sh::section::read(payload, (kind, encoding), conditions, &self.limits)?;
        Ok(GaussianArrays { sh_degree: head.degree, sh_rest, ..gaussians })
    }

    /// Everything. Sections that do not depend on each other are decoded at the same time where there are threads.
    ///
    /// # Errors
    /// As [`crate::decode`].
    pub fn scene(&self) -> Result<SceneData, CodecError> {
        self.check_sections()?;
        let frame = self.frame()?;
        let coupled = self.sh_needs_hexplanes()?;
        let (gaussians, hexplane) = parallel::join(
            || {
                let gaussians = self.gaussians()?;
                if coupled { Ok(gaussians) } else { self.sh(gaussians, &frame, &HexPlaneArrays::default()) }
            },
            || self.hexplanes(),
        );
        let (mut gaussians, hexplane) = (gaussians?, hexplane?);
        if coupled {
            gaussians = self.sh(gaussians, &frame, &hexplane)?;
        }
        let motion = self.motion()?;
        let scene = SceneData { meta: self.container.meta.clone(), gaussians, frame, hexplane, motion };
        check(&scene, &self.limits)?;
        Ok(scene)
    }

    /// Refuses a context model without coded planes, and the other way round.
    fn check_sections(&self) -> Result<(), CodecError> {
        let coded = self.container.section(Section::HexPlanes)?.0 == Kind::HexPlanesContextCoded;
        if self.container.has(Section::ContextModel) && !coded {
            let section = Section::ContextModel.name();
            return Err(CodecError::invalid(section, "section", "there", "none, since no plane is coded with it"));
        }
        Ok(())
    }
}
