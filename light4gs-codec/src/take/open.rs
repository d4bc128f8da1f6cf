//! Reading a take, segment by segment.

use std::{borrow::Cow, ops::Range};
#[cfg(not(target_os = "unknown"))]
use std::{
    fs::File,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

#[cfg(not(target_os = "unknown"))]
use super::index::of_base;
use super::{DrawnSegment, IndexReader, SegmentTimes, TakeIndex, TakeMeta};
use crate::{CodecError, Limits};
#[cfg(not(target_os = "unknown"))]
use crate::{
    file::{name, open_regular, read_at, read_stream_in},
    take::index::of_segment,
};

/// A take whose index has been read. Each call reads the bytes of its part, and no others.
///
/// All methods take `&self`, and several threads may call them at once.
#[derive(Debug)]
pub struct Take {
    index: TakeIndex,
    source: Source,
}

/// Where the bytes are.
#[derive(Debug)]
enum Source {
    Memory(Vec<u8>),
    #[cfg(not(target_os = "unknown"))]
    File {
        path: PathBuf,
        /// Reading moves the file's position, so one thread reads at a time.
        file: Mutex<File>,
        limits: Limits,
    },
}

/// A segment whose bytes have their checksum. Its stream is not decoded yet.
#[derive(Clone, Debug, PartialEq)]
pub struct TakeSegment<'a> {
    /// When it is shown.
    pub times: SegmentTimes,
    /// A `.l4gs` stream, whose time at a moment of the take is [`SegmentTimes::stream_time`].
    pub stream: Cow<'a, [u8]>,
    /// For each Gaussian of the base, whether it is not drawn during the segment; empty where all are drawn.
    pub hidden: Vec<bool>,
}

impl Take {
    /// A take in memory.
    ///
    /// # Errors
    /// No take, or one of a newer version; an index that is damaged, breaks a rule of the format or a limit; bytes that end
    /// before a part that the index names.
    pub fn read(bytes: Vec<u8>, limits: &Limits) -> Result<Self, CodecError> {
        let mut reader = IndexReader::new(limits);
        while let Some(range) = reader.needed() {
            let end = range.end.min(bytes.len() as u64);
            reader.push(&bytes[range.start.min(end) as usize..end as usize])?;
        }
        Ok(Self { index: reader.finish(bytes.len() as u64)?, source: Source::Memory(bytes) })
    }

    /// A take in a file, of which only the index is read. The file may grow; segments that are appended afterwards are seen by
    /// who opens it again.
    ///
    /// # Errors
    /// As [`Take::read`], and what the system refuses; the message names the file.
    #[cfg(not(target_os = "unknown"))]
    pub fn open(path: &Path, limits: &Limits) -> Result<Self, CodecError> {
        let (file, _) = open_regular(path, File::options().read(true))?;
        let index = read_index(path, &file, limits)?;
        let source = Source::File { path: path.to_owned(), file: Mutex::new(file), limits: *limits };
        Ok(Self { index, source })
    }

    /// The first bytes of a take in memory, as a take without segments: what is said of it, and its base.
    /// [`TakeIndex::base`] says where the base ends; what is behind it may be missing.
    ///
    /// # Errors
    /// As [`Take::read`] for the bytes up to the end of the base.
    pub fn read_front(bytes: Vec<u8>, limits: &Limits) -> Result<Self, CodecError> {
        let mut reader = IndexReader::new(limits);
        push_front(&mut reader, |range| {
            let end = range.end.min(bytes.len() as u64);
            Ok(bytes[range.start.min(end) as usize..end as usize].to_vec())
        })?;
        Ok(Self { index: reader.finish_front(bytes.len() as u64)?, source: Source::Memory(bytes) })
    }

    /// The same of a file, which may be a whole take, or one that is cut off behind its base.
    ///
    /// # Errors
    /// As [`Take::read_front`], and what the system refuses; the message names the file.
    #[cfg(not(target_os = "unknown"))]
    pub fn open_front(path: &Path, limits: &Limits) -> Result<Self, CodecError> {
        let (file, bytes) = open_regular(path, File::options().read(true))?;
        let mut reader = IndexReader::new(limits);
        let pushed = push_front(&mut reader, |range| read_at(&file, path, range.start, range.end - range.start));
        let index = pushed.and_then(|()| reader.finish_front(bytes)).map_err(|error| name(path, error))?;
        let source = Source::File { path: path.to_owned(), file: Mutex::new(file), limits: *limits };
        Ok(Self { index, source })
    }

    /// What the front of the file says.
    pub fn index(&self) -> &TakeIndex {
        &self.index
    }

    /// What is said of the whole take.
    pub fn meta(&self) -> &TakeMeta {
        self.index.meta()
    }

    /// Number of segments that are there.
    pub fn len(&self) -> usize {
        self.index.segments().len()
    }

    /// Whether there is no segment yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The segment that is shown at a time in seconds. See [`TakeIndex::segment_at`].
    pub fn segment_at(&self, seconds: f64) -> Option<usize> {
        self.index.segment_at(seconds)
    }

    /// The segments that are drawn at a time in seconds. See [`TakeIndex::drawn_at`].
    pub fn drawn_at(&self, seconds: f64) -> Vec<DrawnSegment> {
        self.index.drawn_at(seconds)
    }

    /// The stream of the base. Its own checksums are checked when it is decoded; then [`TakeIndex::check_base`] says whether it
    /// can be a base.
    ///
    /// # Errors
    /// What the system refuses; a stream whose header is damaged, or that is longer than its head says.
    pub fn base(&self) -> Result<Cow<'_, [u8]>, CodecError> {
        let range = self.index.base();
        match &self.source {
            Source::Memory(bytes) => Ok(Cow::Borrowed(&bytes[range.start as usize..range.end as usize])),
            #[cfg(not(target_os = "unknown"))]
            Source::File { path, file, limits } => {
                let file = file.lock().unwrap_or_else(PoisonError::into_inner);
                let bytes = read_stream_in(path, &file, range, limits);
                bytes.map(Cow::Owned).map_err(|error| name(path, of_base(error)))
            }
        }
    }

    /// A segment, by its number in time from 0, whose bytes are checked against their checksum.
    ///
    /// # Errors
    /// No such segment; bytes that are damaged; what the system refuses.
    pub fn segment(&self, segment: usize) -> Result<TakeSegment<'_>, CodecError> {
        let range = self.index.place(segment)?.range();
        match &self.source {
            // The reader of the index has compared all ranges with the length of the bytes.
            Source::Memory(bytes) => self.index.open_segment(segment, &bytes[range.start as usize..range.end as usize]),
            #[cfg(not(target_os = "unknown"))]
            Source::File { path, file, limits } => {
                let file = file.lock().unwrap_or_else(PoisonError::into_inner);
                self.segment_of_file(segment, path, &file, limits).map_err(|error| name(path, error))
            }
        }
    }

    #[cfg(not(target_os = "unknown"))]
    fn segment_of_file(
        &self,
        segment: usize,
        path: &Path,
        file: &File,
        limits: &Limits,
    ) -> Result<TakeSegment<'static>, CodecError> {
        let place = self.index.place(segment)?;
        let stream_begin = place.offset + u64::from(place.hidden_bytes);
        // A length is not believed: the stream is read only where its header and the heads of its sections agree.
        let stream = read_stream_in(path, file, stream_begin..place.range().end, limits);
        let stream = stream.map_err(|error| of_segment(segment, error))?;
        let mut bytes = read_at(file, path, place.offset, place.hidden_bytes.into())?;
        bytes.extend_from_slice(&stream);
        let TakeSegment { times, hidden, .. } = self.index.open_segment(segment, &bytes)?;
        Ok(TakeSegment { times, stream: stream.into(), hidden })
    }
}

/// Pushes what is before the base.
fn push_front(
    reader: &mut IndexReader,
    mut read: impl FnMut(Range<u64>) -> Result<Vec<u8>, CodecError>,
) -> Result<(), CodecError> {
    while let Some(range) = reader.needed().filter(|_| !reader.has_front()) {
        reader.push(&read(range)?)?;
    }
    Ok(())
}

/// Reads the index of a file.
#[cfg(not(target_os = "unknown"))]
pub(super) fn read_index(path: &Path, file: &File, limits: &Limits) -> Result<TakeIndex, CodecError> {
    let read = || {
        let mut reader = IndexReader::new(limits);
        while let Some(range) = reader.needed() {
            reader.push(&read_at(file, path, range.start, range.end - range.start)?)?;
        }
        // Asked for now: what the index names was written before it.
        let found = file.metadata();
        let found = found.map_err(|error| CodecError::Io { action: "read", path: path.to_owned(), error })?;
        reader.finish(found.len())
    };
    read().map_err(|error| name(path, error))
}
