//! A take taken apart, and put together with checksums that fit (docs/format.md, "Takes").

use light4gs_codec::Limits;
use light4gs_codec::take::{SegmentTimes, Take};

/// Bytes of a row of the index, and before its checksum.
pub(super) const ROW: usize = 64;
pub(super) const COVERED: usize = ROW - 4;
/// Bytes of the prelude; its checksum is the last four.
pub(super) const PRELUDE: usize = 44;

/// A segment.
#[derive(Clone, Debug)]
pub(super) struct SegmentParts {
    pub(super) times: SegmentTimes,
    /// The list of hidden Gaussians, as it is coded.
    pub(super) hidden: Vec<u8>,
    pub(super) stream: Vec<u8>,
}

/// A take without places and checksums.
#[derive(Clone, Debug)]
pub(super) struct TakeParts {
    meta: Vec<u8>,
    pub(super) base: Vec<u8>,
    base_gaussians: u32,
    pub(super) segments: Vec<SegmentParts>,
}

impl TakeParts {
    /// Takes a sound take apart.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let take = Take::read(bytes.to_vec(), &Limits::default()).expect("sound");
        let meta_bytes = u32::from_le_bytes(*bytes[12..].first_chunk().expect("four bytes")) as usize;
        let segments = take.index().segments().iter().map(|place| {
            let range = place.range();
            let (hidden, stream) =
                bytes[range.start as usize..range.end as usize].split_at(place.hidden_bytes as usize);
            SegmentParts { times: place.times, hidden: hidden.to_vec(), stream: stream.to_vec() }
        });
        Self {
            meta: bytes[PRELUDE..PRELUDE + meta_bytes].to_vec(),
            base: take.base().expect("sound").to_vec(),
            base_gaussians: take.index().base_gaussians(),
            segments: segments.collect(),
        }
    }

    /// The take: its index is one block with a slot that is not used, and segments follow the base in their order.
    pub(super) fn assemble(&self) -> Vec<u8> {
        let Self { meta, base, base_gaussians, segments } = self;
        let block = (PRELUDE + meta.len()).next_multiple_of(ROW);
        let base_offset = block + ROW * (2 + segments.len());
        let mut bytes = b"\x89L4GT\r\n\x1a\x01\0\0\0".to_vec();
        bytes.extend((meta.len() as u32).to_le_bytes());
        bytes.extend((1 + segments.len() as u32).to_le_bytes());
        bytes.extend((base_offset as u64).to_le_bytes());
        bytes.extend((base.len() as u64).to_le_bytes());
        bytes.extend(base_gaussians.to_le_bytes());
        let after = [&meta[..], &vec![0; block - PRELUDE - meta.len()]].concat();
        bytes.extend(crc32c::crc32c_append(crc32c::crc32c(&bytes), &after).to_le_bytes());
        bytes.extend(after);
        bytes.extend([0; ROW]);
        let mut offset = base_offset + base.len();
        for SegmentParts { times, hidden, stream } in segments {
            let length = hidden.len() + stream.len();
            let SegmentTimes { begin, end, stream_begin, stream_end, frames } = times;
            let row = bytes.len();
            [begin, end, stream_begin, stream_end].iter().for_each(|time| bytes.extend(time.to_le_bytes()));
            [offset, length].iter().for_each(|&number| bytes.extend((number as u64).to_le_bytes()));
            bytes.extend(frames.to_le_bytes());
            bytes.extend((hidden.len() as u32).to_le_bytes());
            bytes.extend(crc32c::crc32c_append(crc32c::crc32c(hidden), stream).to_le_bytes());
            bytes.extend(crc32c::crc32c(&bytes[row..]).to_le_bytes());
            offset += length;
        }
        bytes.extend([0; ROW]);
        bytes.extend(base);
        segments.iter().for_each(|segment| bytes.extend([&segment.hidden[..], &segment.stream].concat()));
        bytes
    }
}
