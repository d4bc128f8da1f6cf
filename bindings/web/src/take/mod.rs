//! A take, of which the base and some segments are decoded.
//!
//! A segment is named by its `begin`: no two segments have the same one, and it stays where the take grows.

mod description;
mod unpacked;

use light4gs_codec::take::{DrawnSegment, SegmentPart, SegmentPlace, TakeIndex, drawn_together};
use light4gs_codec::{CodecError, Decoded, Limits, OpenStream, SceneData, decode_with_limits};

use self::unpacked::Unpacked;
use crate::description::{Facts, describe};
use crate::draw_list::{DrawList, Share, Viewpoint, WHOLE};
use crate::gaussians::activated;
use crate::levels::levels;
use crate::limits::{limits, take_limits};
use crate::part::Part;

pub(crate) use self::description::{describe_index, describe_range};

/// A take whose index is known.
#[derive(Debug)]
pub struct OpenTake {
    index: TakeIndex,
    /// None before it has come.
    base: Option<Part>,
    segments: Vec<Segment>,
    /// Those of `segments` that are drawn, with their weights: two around a join.
    shown: Vec<(usize, f32)>,
    list: DrawList,
}

/// A segment that is decoded.
#[derive(Debug)]
struct Segment {
    place: SegmentPlace,
    part: Part,
    hidden: Vec<bool>,
}

impl OpenTake {
    /// A take of which nothing but the index is there.
    pub fn new(index: TakeIndex) -> Self {
        Self { index, base: None, segments: Vec::new(), shown: Vec::new(), list: DrawList::default() }
    }

    /// Takes the index of a take that may have grown: all that was there is still there, be it at another place of a file that was
    /// written anew. Another index is not taken. Returns whether it was.
    pub fn grow(&mut self, index: TakeIndex) -> bool {
        let begin_of = |place: &SegmentPlace| place.times.begin;
        let is_there = |place: &SegmentPlace| {
            let found = index.segments().binary_search_by(|other| begin_of(other).total_cmp(&begin_of(place)));
            found.is_ok_and(|number| SegmentPlace { offset: place.offset, ..index.segments()[number] } == *place)
        };
        let base_of = |index: &TakeIndex| (index.base().end - index.base().start, index.base_gaussians());
        let same_base = base_of(&index) == base_of(&self.index);
        let grown = same_base && self.index.segments().iter().all(is_there);
        if grown {
            self.index = index;
        }
        grown
    }

    /// Decodes the base, and returns what its stream says as JSON.
    ///
    /// # Errors
    /// A damaged stream, a base that moves, or another number of Gaussians than the index says.
    pub fn open_base(&mut self, stream: &[u8]) -> Result<String, CodecError> {
        self.base = None;
        let Decoded { scene, info, .. } = OpenStream::with_limits(stream, &take_limits())?.decode()?;
        self.index.check_base(&info)?;
        let facts = Facts { bytes: stream.len() as u64, layers: 1, shown: 1, sections: &[] };
        let description = describe(&scene, &facts, levels(scene.gaussians.len()));
        let mut base = Part::new(scene)?;
        base.evaluate(0.0, 0, base.count());
        self.base = Some(base);
        Ok(description)
    }

    /// Checks and decodes a segment from its bytes in the file, into bytes that [`OpenTake::open_segment`] opens quickly: so
    /// the decoding can be left to another instance, and the one that draws does not stop for it.
    ///
    /// # Errors
    /// No such segment, or one that is damaged.
    pub fn unpack_segment(&self, begin: f64, bytes: &[u8]) -> Result<Vec<u8>, CodecError> {
        let (number, _) = self.find(begin)?;
        let segment = self.index.open_segment(number, bytes)?;
        let scene = decode_with_limits(&segment.stream, &take_limits())?;
        Unpacked { scene, hidden: segment.hidden }.write()
    }

    /// Opens a segment that was unpacked. Returns the number of its Gaussians and of their levels of detail.
    ///
    /// # Errors
    /// No such segment, or bytes of something else.
    pub fn open_segment(&mut self, begin: f64, unpacked: &[u8]) -> Result<(usize, u32), CodecError> {
        let (_, place) = self.find(begin)?;
        let Unpacked { scene, hidden } = Unpacked::read(unpacked)?;
        let count = scene.gaussians.len();
        self.close_segment(begin);
        self.segments.push(Segment { place, part: Part::new(scene)?, hidden });
        Ok((count, levels(count)))
    }

    /// Frees a segment.
    pub fn close_segment(&mut self, begin: f64) {
        self.segments.retain(|segment| segment.place.times.begin != begin);
        self.shown.clear();
    }

    /// Chooses what is drawn: the base, and the segments of a time in seconds that are open; and the level of detail of all
    /// of them. Returns whether something was chosen of which nothing is evaluated yet.
    pub fn show(&mut self, seconds: f64, level: u32) -> bool {
        let before: Vec<usize> = self.shown.iter().map(|(number, _)| *number).collect();
        self.shown = self.open_at(seconds);
        if let Some(base) = &mut self.base
            && base.show_level(level)
        {
            base.evaluate(0.0, 0, base.count());
        }
        let mut new = false;
        for &(number, _) in &self.shown {
            new |= self.segments[number].part.show_level(level) || !before.contains(&number);
        }
        new
    }

    /// The open ones of the segments that are drawn at a time, with their weights. One that is not open leaves its share to the
    /// other.
    fn open_at(&self, seconds: f64) -> Vec<(usize, f32)> {
        let drawn = self.index.drawn_at(seconds).into_iter();
        let mut open: Vec<_> = drawn
            .filter_map(|DrawnSegment { segment, weight }| {
                let begin = self.index.segments()[segment].times.begin;
                let number = self.segments.iter().position(|open| open.place.times.begin == begin)?;
                Some((number, weight))
            })
            .collect();
        if let [(_, weight)] = &mut open[..] {
            *weight = 1.0;
        }
        open
    }

    /// Number of Gaussians that [`OpenTake::evaluate`] moves: those of the segments, since the base stands still.
    pub fn count(&self) -> usize {
        self.shown.iter().map(|(number, _)| self.segments[*number].part.count()).sum()
    }

    /// Computes the Gaussians `first` to `last` of the segments, one after the other, at a time in seconds.
    pub fn evaluate(&mut self, seconds: f64, first: usize, last: usize) {
        let mut begin = 0;
        for (number, _) in &self.shown {
            let Segment { place, part, .. } = &mut self.segments[*number];
            let count = part.count();
            let within = |index: usize| index.saturating_sub(begin).min(count);
            let (first, last) = (within(first), within(last));
            if first < last {
                part.evaluate(place.times.stream_time(seconds), first, last);
            }
            begin += count;
        }
    }

    /// The weight of the later segment where two are drawn, around a join; 0 elsewhere.
    pub fn weight_of_later(&self) -> f32 {
        if let [_, (_, weight)] = self.shown[..] { weight } else { 0.0 }
    }

    /// The base and one segment of those that are drawn, by its place among them, as computed last and as [`OpenTake::draw_list`]
    /// has them: around a join, the picture is the mean of the pictures of the two by their weights.
    pub fn draw_list_with(&mut self, place: usize, viewpoint: &Viewpoint) -> &[f32] {
        let Some(segment) = self.shown.get(place).map(|(number, _)| &self.segments[*number]) else { return &[] };
        let shares = [(&segment.hidden[..], 1.0)];
        let base = self.base.iter().map(|base| base.drawn(&shares));
        let parts: Vec<_> = base.chain([segment.part.drawn(WHOLE)]).collect();
        self.list.make(&parts, viewpoint)
    }

    /// Base and segments as computed last, back to front, [`ENTRY`](crate::ENTRY) numbers each. Two segments have the opacities of
    /// [`drawn_together`].
    pub fn draw_list(&mut self, viewpoint: &Viewpoint) -> &[f32] {
        let shares: Vec<Share<'_>> =
            self.shown.iter().map(|&(number, weight)| (&self.segments[number].hidden[..], weight)).collect();
        let own: Vec<[Share<'_>; 1]> = self.shown.iter().map(|&(_, weight)| [(&[][..], weight)]).collect();
        let base = self.base.iter().map(|base| base.drawn(if shares.is_empty() { WHOLE } else { &shares }));
        let segments = self.shown.iter().zip(&own).map(|((number, _), own)| self.segments[*number].part.drawn(own));
        let parts: Vec<_> = base.chain(segments).collect();
        self.list.make(&parts, viewpoint)
    }

    /// The attributes of base and segments at a time in seconds, as of [`OpenScene::attributes_at`](crate::OpenScene::attributes_at),
    /// and the degree of the harmonics.
    pub fn attributes_at(&self, seconds: f64) -> (Vec<f32>, u8) {
        let open = self.open_at(seconds).into_iter().map(|(number, weight)| {
            let Segment { place, part, hidden } = &self.segments[number];
            (hidden, part.moved_at(place.times.stream_time(seconds)), weight)
        });
        let open: Vec<_> = open.collect();
        let parts = open.iter().map(|(hidden, moved, weight)| SegmentPart { hidden, moved, weight: *weight });
        let nothing = SceneData::default().gaussians;
        let base = self.base.as_ref().map_or(&nothing, Part::canonical);
        let drawn = drawn_together(base, &parts.collect::<Vec<_>>());
        (activated(&drawn), drawn.sh_degree)
    }

    /// The number and the place of the segment with this begin.
    fn find(&self, begin: f64) -> Result<(usize, SegmentPlace), CodecError> {
        let mut places = self.index.segments().iter().enumerate();
        let found = places.find(|(_, place)| place.times.begin == begin);
        found.map(|(number, place)| (number, *place)).ok_or_else(|| CodecError::Invalid {
            section: "take",
            field: "begin of a segment".into(),
            found: begin.to_string(),
            expected: "that of a segment of the index".into(),
        })
    }
}

/// Limits for what another instance has unpacked: plain numbers are longer than what was coded.
fn unpacked_limits() -> Limits {
    Limits { memory_bytes: limits().memory_bytes.saturating_mul(4), ..limits() }
}

#[cfg(test)]
mod tests;
