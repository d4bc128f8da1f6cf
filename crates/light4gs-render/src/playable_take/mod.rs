//! A take that can be computed and drawn at any time.

#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use light4gs_codec::{
    CodecError, GaussianArrays, Limits,
    take::{DrawnSegment, SegmentPart, SegmentTimes, Take, TakeSegment, drawn_together},
};
use light4gs_data::Camera;

use crate::playable::PlayableScene;

/// Segments that are kept decoded unless a program asks for another number: the one that is shown, and those beside it.
const KEPT: usize = 3;
/// Around a join two of them are drawn.
const LEAST_KEPT: usize = 2;

/// A take: minutes that can be computed and drawn at any time.
///
/// The base is decoded once. Segments are decoded when they are needed, and the last three that were used are kept, or as many
/// as [`PlayableTake::keeping`] says. All methods take `&self`, and several threads may call them at once, those of
/// rayon's pool included.
///
/// ```no_run
/// use light4gs_codec::Limits;
/// use light4gs_data::Camera;
/// use light4gs_render::PlayableTake;
///
/// let take = PlayableTake::open("take.l4gs".as_ref(), &Limits::default())?;
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 400, 300);
/// let image = take.render(&camera, 75.0, take.base().info().meta.background)?; // a minute and a quarter after the begin
/// assert_eq!(image.len(), 300 * 400 * 3);
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Debug)]
pub struct PlayableTake {
    take: Take,
    base: PlayableScene,
    limits: Limits,
    most: usize,
    kept: Mutex<Kept>,
}

/// Decoded segments by their numbers, the one that was used last at the end.
#[derive(Debug, Default)]
struct Kept(Vec<(usize, Arc<Shown>)>);

impl Kept {
    /// The segment, which is now the one that was used last.
    fn take(&mut self, number: usize) -> Option<Arc<Shown>> {
        let at = self.0.iter().position(|(other, _)| *other == number)?;
        let entry = self.0.remove(at);
        let shown = entry.1.clone();
        self.0.push(entry);
        Some(shown)
    }

    /// Keeps a segment, and at most this number in all. Returns that of another thread, where it was faster.
    fn put(&mut self, number: usize, new: Arc<Shown>, most: usize) -> Arc<Shown> {
        if let Some(shown) = self.take(number) {
            return shown;
        }
        let surplus = (self.0.len() + 1).saturating_sub(most);
        self.0.drain(..surplus);
        self.0.push((number, new.clone()));
        new
    }
}

/// A decoded segment, and what it hides.
#[derive(Debug)]
struct Shown {
    times: SegmentTimes,
    scene: PlayableScene,
    hidden: Vec<bool>,
}

impl PlayableTake {
    /// A take whose index has been read. Its base is decoded.
    ///
    /// # Errors
    /// As [`PlayableScene::decode`] for the base; a base that moves, or that has another number of Gaussians than the take says;
    /// what the system refuses.
    pub fn new(take: Take, limits: &Limits) -> Result<Self, CodecError> {
        let base = PlayableScene::decode(&take.base()?, limits).map_err(|error| of_part("base".into(), error))?;
        take.index().check_base(base.info())?;
        Ok(Self { take, base, limits: *limits, most: KEPT, kept: Mutex::default() })
    }

    /// A take in memory.
    ///
    /// # Errors
    /// As [`Take::read`] and [`PlayableTake::new`].
    pub fn decode(bytes: Vec<u8>, limits: &Limits) -> Result<Self, CodecError> {
        Self::new(Take::read(bytes, limits)?, limits)
    }

    /// A take in a file, of which the index and the base are read. Not in a browser, which has none.
    ///
    /// # Errors
    /// As [`Take::open`] and [`PlayableTake::new`].
    #[cfg(not(target_os = "unknown"))]
    pub fn open(path: &std::path::Path, limits: &Limits) -> Result<Self, CodecError> {
        Self::new(Take::open(path, limits)?, limits)
    }

    /// The same, with another number of segments that are kept decoded; at least two are, as two are drawn around a join.
    pub fn keeping(self, most: usize) -> Self {
        Self { most: most.max(LEAST_KEPT), ..self }
    }

    /// The file: its metadata, and when its segments are shown.
    pub fn take(&self) -> &Take {
        &self.take
    }

    /// What stands still over the whole take.
    pub fn base(&self) -> &PlayableScene {
        &self.base
    }

    /// Numbers of the segments that are decoded, the one that was used last at the end.
    pub fn decoded(&self) -> Vec<usize> {
        self.kept().0.iter().map(|(number, _)| *number).collect()
    }

    /// Decodes the segments that are drawn at a time in seconds, so that they are there when they are needed: for a thread that
    /// runs ahead of the player. Nothing happens where none is.
    ///
    /// # Errors
    /// As [`PlayableTake::at`].
    pub fn prepare(&self, seconds: f64) -> Result<(), CodecError> {
        self.drawn_at(seconds).map(|_| ())
    }

    /// The Gaussians at a time of the take in seconds, before their activations: those of the base that are not hidden, then
    /// those of the segment, or of two around a join, as [`drawn_together`] puts them ([`PlayableTake::render`] draws the two
    /// apart); those of the base alone where no segment is shown. To the bit the same on every machine. Takes one thread, and
    /// more to decode a segment.
    ///
    /// # Errors
    /// A time that is NaN or infinite; a segment that is damaged; what the system refuses.
    pub fn at(&self, seconds: f64) -> Result<GaussianArrays, CodecError> {
        self.gaussians(seconds, &self.drawn_at(seconds)?)
    }

    /// An image `[height, width, 3]` of the take at a time in seconds: red, green, blue over the background, 0 or more and not
    /// clamped above. Around a join it is the mean of the images with each of the two segments alone, by their weights: errors of
    /// the two average out, where two models in one scene cover each other. Takes the threads of rayon's current pool; the
    /// numbers do not depend on how many there are.
    ///
    /// # Errors
    /// As [`PlayableTake::at`]; for the size of the image and its memory as [`PlayableScene::render`].
    pub fn render(&self, camera: &Camera, seconds: f64, background: [f32; 3]) -> Result<Vec<f32>, CodecError> {
        let drawn = self.drawn_at(seconds)?;
        if let [] | [_] = drawn[..] {
            return self.image(camera, seconds, background, &drawn);
        }
        let mut mean = Vec::new();
        for (shown, weight) in drawn {
            let image = self.image(camera, seconds, background, &[(shown, 1.0)])?;
            mean.resize(image.len(), 0.0);
            mean.iter_mut().zip(&image).for_each(|(sum, value)| *sum += weight * value);
        }
        Ok(mean)
    }

    /// The image with the base and these segments in one scene.
    fn image(
        &self,
        camera: &Camera,
        seconds: f64,
        background: [f32; 3],
        drawn: &[(Arc<Shown>, f32)],
    ) -> Result<Vec<f32>, CodecError> {
        let (mut allowance, mut count) = (self.base.allowance(), self.base.len());
        // Harmonics are padded to the largest degree: at most as many as the widest would have for all.
        let width = |scene: &PlayableScene| scene.numbers().div_ceil(scene.len().max(1));
        let mut widest = width(&self.base);
        for (shown, _) in drawn {
            allowance = allowance.max(shown.scene.allowance());
            count += shown.scene.len();
            widest = widest.max(width(&shown.scene));
        }
        allowance.image(camera, background, (count, count * widest), || self.gaussians(seconds, drawn))
    }

    fn gaussians(&self, seconds: f64, drawn: &[(Arc<Shown>, f32)]) -> Result<GaussianArrays, CodecError> {
        let moved = drawn.iter().map(|(shown, _)| shown.scene.at(shown.times.stream_time(seconds)));
        let moved = moved.collect::<Result<Vec<_>, _>>()?;
        let parts = drawn.iter().zip(&moved).map(|((shown, weight), moved)| SegmentPart {
            hidden: &shown.hidden,
            moved,
            weight: *weight,
        });
        Ok(drawn_together(self.base.canonical(), &parts.collect::<Vec<_>>()))
    }

    /// The segments that are drawn at a time, decoded, and their weights.
    fn drawn_at(&self, seconds: f64) -> Result<Vec<(Arc<Shown>, f32)>, CodecError> {
        if !seconds.is_finite() {
            return Err(CodecError::Invalid {
                section: "rendering",
                field: "time".into(),
                found: seconds.to_string(),
                expected: "a finite number of seconds".into(),
            });
        }
        let drawn = self.take.drawn_at(seconds).into_iter();
        drawn.map(|DrawnSegment { segment, weight }| Ok((self.decoded_segment(segment)?, weight))).collect()
    }

    fn decoded_segment(&self, number: usize) -> Result<Arc<Shown>, CodecError> {
        if let Some(shown) = self.kept().take(number) {
            return Ok(shown);
        }
        // Not while the list is locked: decoding works in rayon's pool, whose threads may turn to another caller's work, and wait
        // for the list there. So two threads may decode the same segment at once.
        let new = Arc::new(self.decode_segment(number)?);
        Ok(self.kept().put(number, new, self.most))
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn decode_segment(&self, number: usize) -> Result<Shown, CodecError> {
        let TakeSegment { times, stream, hidden } = self.take.segment(number)?;
        let scene = PlayableScene::decode(&stream, &self.limits);
        Ok(Shown { times, scene: scene.map_err(|error| of_part(format!("segment {number}"), error))?, hidden })
    }
}

/// An error of a stream of the take.
fn of_part(part: String, error: CodecError) -> CodecError {
    CodecError::InTake { part, error: Box::new(error) }
}
