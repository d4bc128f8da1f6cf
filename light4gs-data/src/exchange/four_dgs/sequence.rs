//! The records of a file, written sample by sample.
//!
//! The crate `fourdgs` has a writer too (`write_sequence`), which holds all samples at once. This one puts the crate's records and
//! streams together as the samples come, so that a file of minutes takes the memory of two of them. A test compares the bytes.

use std::io::{Seek, SeekFrom, Write};

use fourdgs::MAGIC;
use fourdgs::records::{
    ChunkIndexEntry, DELTA_MODE_CHAINED, Footer, Header, Quantization, Statistics, WindowTable, encode_chunk,
    encode_delta_chunk,
};
use fourdgs::serialization::crc32;

use super::columns::{Columns, Grid};
use super::{MotionSample, Refusal};
use crate::ply::GaussianPly;

/// Samples from one keyframe to the next.
const KEYFRAME_INTERVAL: u16 = 8;
/// Opacity below which a reader need not draw: that of the crate's writer.
const CUTOFF: f64 = 0.05;

/// A sample, whose end is the begin of the next one.
struct Pending {
    begin: f64,
    columns: Columns,
    /// Samples since the keyframe.
    depth: u16,
    /// What is stored of it.
    stored: Stored,
}

enum Stored {
    Keyframe(Vec<u8>),
    Changes { count: u32, streams: Vec<u8> },
}

/// Writes a file.
pub(super) struct SequenceWriter<'a, W> {
    file: &'a mut W,
    /// Bytes that are written.
    length: u64,
    duration: f64,
    grid: Grid,
    /// Identities that have been given.
    identities: i64,
    /// The box around all positions.
    low: [f64; 3],
    high: [f64; 3],
    pending: Option<Pending>,
    index: Vec<ChunkIndexEntry>,
}

impl<'a, W: Write + Seek> SequenceWriter<'a, W> {
    pub(super) fn begin(file: &'a mut W, typical: &GaussianPly, duration: f64) -> Result<Self, Refusal> {
        let grid = Grid::of(typical, duration);
        if !(duration > 0.0 && duration.is_finite()) {
            return Err(Refusal::Reason(format!("they last {duration} seconds, expected a time above 0")));
        }
        if !grid.is_usable() {
            return Err(Refusal::Reason("a position or a scale is not finite, or all scales are 0".into()));
        }
        let (low, high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (pending, index) = (None, Vec::new());
        let mut writer = Self { file, length: 0, duration, grid, identities: 0, low, high, pending, index };
        writer.write(&MAGIC)?;
        let header = writer.header();
        writer.write(&header)?;
        let Grid { origin, steps, .. } = &writer.grid;
        let quantization = Quantization {
            scheme: "uniform-v1".into(),
            pos_origin: origin.to_vec(),
            step_pos: steps.pos,
            step_scale_log: steps.scale_log,
            step_rot: steps.rot,
            step_rgb: steps.rgb,
            step_alpha: steps.alpha,
            step_motion: steps.motion,
            step_time: steps.time,
            step_sigma_log: steps.sigma_log,
            step_sh: steps.sh,
            bounds: Default::default(),
            sh_bit_depths: Vec::new(),
        };
        writer.write(&quantization.encode(&[]))?;
        writer.write(&WindowTable { windows: vec![(0.0, duration)] }.encode())?;
        Ok(writer)
    }

    /// Adds the next sample, and writes the one before.
    pub(super) fn add(&mut self, sample: &MotionSample) -> Result<(), Refusal> {
        let MotionSample { begin, anew, gaussians } = sample;
        let previous = self.pending.as_ref().map(|before| before.begin);
        let in_order = previous.map_or(*begin == 0.0, |before| *begin > before);
        if !in_order || *begin >= self.duration {
            let expected = previous.map_or("0 for the first one".into(), |before| format!("more than {before}"));
            let duration = self.duration;
            return Err(Refusal::Reason(format!("t0 is {begin}, expected {expected}, and less than {duration}")));
        }
        let before = self.write_pending(*begin)?.filter(|before| !anew && before.columns.len() == gaussians.len());
        let depth = before.as_ref().map_or(0, |before| (before.depth + 1) % KEYFRAME_INTERVAL);
        let first_id = before.as_ref().map_or(self.identities, |before| before.columns.first_id());
        if before.is_none() {
            self.identities += gaussians.len() as i64;
        }
        // Gaussians come at their keyframe, and what does not move until the next one does not change.
        let keyframe = &self.index[self.index.len() - usize::from(depth).min(self.index.len())..];
        let birth = keyframe.first().map_or(*begin, |entry| entry.t0);
        let columns = Columns::of(gaussians, &self.grid, birth, first_id);
        let columns = columns.ok_or_else(|| Refusal::Reason(format!("a number at {begin} s is not finite")))?;
        let stored = match before.filter(|_| depth > 0) {
            Some(before) => {
                let (count, streams) = columns.changes(&before.columns)?;
                Stored::Changes { count, streams }
            }
            None => Stored::Keyframe(columns.keyframe()?),
        };
        for mean in &gaussians.means {
            for (axis, value) in mean.iter().map(|value| f64::from(*value)).enumerate() {
                self.low[axis] = self.low[axis].min(value);
                self.high[axis] = self.high[axis].max(value);
            }
        }
        self.pending = Some(Pending { begin: *begin, columns, depth, stored });
        Ok(())
    }

    /// Writes the last sample, the index and the numbers of the head.
    pub(super) fn finish(mut self) -> Result<(), Refusal> {
        if self.write_pending(self.duration)?.is_none() {
            return Err(Refusal::Reason("there are none".into()));
        }
        let summary_start = self.length;
        let statistics = Statistics {
            gaussian_count: self.identities as u64,
            chunk_count: self.index.len() as u32,
            duration_sec: self.duration,
            aabb: self.bounds(),
        };
        let mut summary: Vec<u8> = self.index.iter().flat_map(ChunkIndexEntry::encode).collect();
        summary.extend(statistics.encode());
        self.write(&summary)?;
        let footer = Footer { summary_start, summary_offset_start: 0, summary_crc: crc32(&summary) };
        self.write(&footer.encode())?;
        self.write(&MAGIC)?;
        // Its length depends on no number.
        let header = self.header();
        self.file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        self.file.write_all(&header)?;
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.length += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Writes the sample that waits for its end, and returns it.
    fn write_pending(&mut self, end: f64) -> Result<Option<Pending>, Refusal> {
        let Some(pending) = self.pending.take() else { return Ok(None) };
        let Pending { begin, columns, depth, stored } = &pending;
        let (at, count) = (self.length, columns.len());
        let mut entry = ChunkIndexEntry {
            t0: *begin,
            t1: end,
            chunk_offset: at,
            bands: Vec::new(),
            extended: true,
            keyframe_offset: at,
            depth: *depth,
            live_count: count as u64,
            gaussian_count: count as u32,
            ..ChunkIndexEntry::default()
        };
        let record = match (stored, self.index.last()) {
            (Stored::Changes { count, streams }, Some(before)) => {
                entry.kind = 1;
                entry.delta_mode = DELTA_MODE_CHAINED;
                entry.gaussian_count = *count;
                entry.reference_offset = before.chunk_offset;
                entry.keyframe_offset = before.keyframe_offset;
                let (reference, keyframe) = (entry.reference_offset, entry.keyframe_offset);
                // Nothing comes or goes between keyframes.
                let counts = (*count, 0, 0);
                encode_delta_chunk(
                    *begin,
                    end,
                    0,
                    DELTA_MODE_CHAINED,
                    reference,
                    keyframe,
                    *depth,
                    streams,
                    &[],
                    &[],
                    counts,
                )
            }
            (Stored::Keyframe(streams) | Stored::Changes { streams, .. }, _) => {
                encode_chunk(*begin, end, 0, count as u32, streams)
            }
        };
        entry.chunk_length = record.len() as u64;
        self.write(&record)?;
        self.index.push(entry);
        Ok(Some(pending))
    }

    /// The head of the file, with what is known so far.
    fn header(&self) -> Vec<u8> {
        let header = Header {
            profile: "fine".into(),
            library: concat!("Light4GS ", env!("CARGO_PKG_VERSION")).into(),
            duration_sec: self.duration,
            gaussian_count: self.identities as u64,
            cutoff: CUTOFF,
            temporal_model: "keyframe-delta".into(),
            aabb: self.bounds(),
            sh_degree: 0,
            flags: 0,
            attributes: Default::default(),
        };
        header.encode(&[])
    }

    fn bounds(&self) -> Vec<f64> {
        if self.low[0] > self.high[0] { vec![0.0; 6] } else { [self.low, self.high].concat() }
    }
}
