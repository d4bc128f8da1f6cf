//! Decoding while the bytes come.

use super::{
    SectionInfo, check, check_layer,
    container::{Header, PRELUDE, Prelude},
    layers::LayerHeads,
    open::{Harmonics, OpenStream, append_within},
};
use crate::{
    CodecError, Demand, GaussianArrays, Limits, SceneData, SceneMeta, budget::Budget, sh::section::FirstCoding,
};

/// Decodes a stream while its bytes come. The scene grows by one layer of Gaussians after the other.
///
/// [`StreamDecoder::push`] takes bytes, in pieces of any length, and finds damage as soon as the bytes of a section are
/// complete; it takes little time. [`StreamDecoder::decode`] decodes what is complete, each section once. The scene is
/// that of [`decode`](crate::decode) to the bit, without the Gaussians of the layers that have not come; a file of one layer
/// comes all at once. The decoder keeps the bytes of the stream and one scene; memory and time are bounded by the
/// [`Limits`] for as many bytes as have come. After an error a new decoder is needed.
///
/// A connection that broke is resumed at [`StreamDecoder::received`], such as by an HTTP range request.
///
/// ```
/// use light4gs_codec::{SceneData, StreamDecoder, decode, encode};
///
/// let bytes = encode(&SceneData::default())?;
/// let mut decoder = StreamDecoder::new();
/// for piece in bytes.chunks(100) {
///     decoder.push(piece)?;
///     if decoder.decode()? > 0 {
///         let scene = decoder.scene().expect("a layer is decoded");
///         println!("{} Gaussians so far", scene.gaussians.len());
///     }
/// }
/// assert_eq!(decoder.finish()?, decode(&bytes)?);
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Debug)]
pub struct StreamDecoder {
    limits: Limits,
    bytes: Vec<u8>,
    header: Option<Header>,
    /// Sections, in the order of the stream, that have come and have their checksums.
    verified: usize,
    /// Whether the length of the next section has been compared with its head.
    length_checked: bool,
    /// Number of bytes that have gone into checksums, and the checksum of those of the next section.
    summed: u64,
    sum: u32,
    /// Without Gaussians before the first layer.
    scene: Option<SceneData>,
    decoded: usize,
    heads: LayerHeads,
    first_coding: Option<FirstCoding>,
    /// Memory and time of what has been decoded.
    spent: Demand,
    /// Whether the next part asks for more memory or time than the bytes so far allow.
    waits: bool,
    failed: bool,
}

impl Default for StreamDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl StreamDecoder {
    /// A decoder that waits for the first byte.
    pub fn new() -> Self {
        Self::with_limits(&Limits::default())
    }

    /// As [`StreamDecoder::new`], within limits of the caller.
    pub fn with_limits(limits: &Limits) -> Self {
        Self {
            limits: *limits,
            bytes: Vec::new(),
            header: None,
            verified: 0,
            length_checked: false,
            summed: 0,
            sum: 0,
            scene: None,
            decoded: 0,
            heads: LayerHeads::default(),
            first_coding: None,
            spent: Demand::default(),
            waits: false,
            failed: false,
        }
    }

    /// Takes the next bytes of the stream.
    ///
    /// # Errors
    /// Those of [`crate::decode`] that show without decoding: a header that is damaged or of another format; a section
    /// with another checksum; more bytes than the header says. Also a decoder that has failed before.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), CodecError> {
        self.unless_failed(|decoder| decoder.take(bytes))
    }

    /// Decodes the parts that have come since the last call. Returns the number of layers that [`StreamDecoder::scene`]
    /// has.
    ///
    /// # Errors
    /// As [`crate::decode`]; a decoder that has failed.
    pub fn decode(&mut self) -> Result<usize, CodecError> {
        self.decode_until(usize::MAX)
    }

    /// As [`StreamDecoder::decode`], but stops when `layers` are decoded, for a program that wants to show them before it goes
    /// on.
    ///
    /// # Errors
    /// As [`StreamDecoder::decode`].
    pub fn decode_until(&mut self, layers: usize) -> Result<usize, CodecError> {
        self.unless_failed(|decoder| decoder.decode_complete(layers))?;
        Ok(self.decoded)
    }

    /// The scene with the Gaussians of the layers that were decoded; none before the first.
    pub fn scene(&self) -> Option<&SceneData> {
        self.scene.as_ref().filter(|_| self.decoded > 0)
    }

    /// The whole scene.
    ///
    /// # Errors
    /// As [`crate::decode`]: a stream that has not come to its end is cut short.
    pub fn finish(mut self) -> Result<SceneData, CodecError> {
        let received = self.received();
        let needed = self.stated().unwrap_or(PRELUDE as u64);
        if received < needed && !self.failed {
            return Err(CodecError::Truncated {
                section: "stream",
                field: "the whole".into(),
                needed,
                available: received,
            });
        }
        self.decode()?;
        // All bytes are there, so all sections are.
        self.scene.ok_or(CodecError::MissingSection { section: "stream" })
    }

    /// Bytes that have come: the offset at which a connection that broke is resumed.
    pub fn received(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Bytes of the whole stream, known after the first 32 bytes.
    pub fn stated(&self) -> Option<u64> {
        let known = self.header.as_ref().map(|header| header.prelude.file_bytes);
        known.or_else(|| Prelude::read(&self.bytes, &self.limits).ok().map(|prelude| prelude.file_bytes))
    }

    /// Layers of the whole stream, once its header has come.
    pub fn layers(&self) -> Option<usize> {
        self.header.as_ref().map(Header::layers)
    }

    /// The scene meta, once the header has come.
    pub fn meta(&self) -> Option<&SceneMeta> {
        self.header.as_ref().map(|header| &header.meta)
    }

    /// The sections of the whole stream, once its header has come.
    pub fn sections(&self) -> Option<Vec<SectionInfo>> {
        self.header.as_ref().map(Header::sections)
    }

    fn unless_failed(&mut self, work: impl FnOnce(&mut Self) -> Result<(), CodecError>) -> Result<(), CodecError> {
        if self.failed {
            let expected = "a new decoder, since this one has refused the stream";
            return Err(CodecError::invalid("stream", "decoder", "used after an error", expected));
        }
        let answer = work(self);
        if answer.is_err() {
            let limits = self.limits;
            *self = Self { failed: true, ..Self::with_limits(&limits) };
        }
        answer
    }

    fn take(&mut self, bytes: &[u8]) -> Result<(), CodecError> {
        self.make_room(bytes.len());
        self.bytes.extend_from_slice(bytes);
        if self.header.is_none() {
            self.read_header()?;
        }
        let Some(header) = &self.header else { return Ok(()) };
        let (stated, there) = (header.prelude.file_bytes, self.bytes.len() as u64);
        if there > stated {
            return Err(CodecError::TrailingBytes { section: "stream", bytes: there - stated });
        }
        while let Some(entry) = header.entries.get(self.verified) {
            if !self.length_checked && there >= entry.offset + entry.head_bytes() {
                let beginning = &self.bytes[entry.offset as usize..][..entry.head_bytes() as usize];
                entry.check_length(beginning, &self.limits)?;
                self.length_checked = true;
            }
            let until = entry.end().min(there);
            let new = &self.bytes[self.summed as usize..until as usize];
            self.sum = crc32c::crc32c_append(self.sum, new);
            self.summed = until;
            if until < entry.end() {
                break;
            }
            entry.check(self.sum)?;
            (self.sum, self.length_checked) = (0, false);
            self.verified += 1;
        }
        Ok(())
    }

    /// Makes room for more bytes: twice that of before, but no more than the stream has.
    fn make_room(&mut self, more: usize) {
        let needed = self.bytes.len() + more;
        if let Some(header) = &self.header
            && needed > self.bytes.capacity()
        {
            let doubled = (2 * self.bytes.capacity() as u64).min(header.prelude.file_bytes) as usize;
            self.bytes.reserve_exact(doubled.max(needed) - self.bytes.len());
        }
    }

    /// Reads the header, if all of it is there. Until then only its fixed part is looked at.
    fn read_header(&mut self) -> Result<(), CodecError> {
        let prelude = match Prelude::read(&self.bytes, &self.limits) {
            Err(CodecError::Truncated { .. }) if self.bytes.len() < PRELUDE => return Ok(()),
            prelude => prelude?,
        };
        let (needed, available) = (prelude.header_bytes(), prelude.file_bytes);
        if needed > available {
            let field = "meta and table".into();
            return Err(CodecError::Truncated { section: "header", field, needed, available });
        }
        if needed > self.received() {
            return Ok(());
        }
        self.header = Some(Header::read(&self.bytes, prelude, &self.limits)?);
        self.summed = needed;
        Ok(())
    }

    fn decode_complete(&mut self, layers: usize) -> Result<(), CodecError> {
        while let Some(header) = self.header.as_ref().filter(|_| self.decoded < layers) {
            let there = self.received() == header.prelude.file_bytes;
            let shared = self.scene.is_some();
            let needed = if shared { header.layer_bytes(self.decoded) } else { header.shared_bytes() };
            let done = shared && self.decoded == header.layers().max(1);
            if done || self.summed < needed || self.waits && !there {
                break;
            }
            let limits = self.limits.for_stream(self.bytes.len());
            let budget = Budget::resumed(&limits, self.spent);
            let answer = if shared { self.decode_layer(limits, &budget) } else { self.decode_shared(limits, &budget) };
            let whole = self.stated().map_or(limits, |bytes| self.limits.for_stream(bytes as usize));
            if answer.is_err() && budget.is_exhausted() && limits != whole {
                // The whole stream may ask for more. It is tried once more, when it is there.
                self.waits = true;
                break;
            }
            answer?;
            self.spent = budget.demand();
        }
        Ok(())
    }

    fn decode_shared(&mut self, limits: Limits, budget: &Budget) -> Result<(), CodecError> {
        let Some(header) = &self.header else { return Ok(()) };
        self.scene = Some(OpenStream::beginning(&self.bytes, header, limits).shared_within(budget)?);
        Ok(())
    }

    fn decode_layer(&mut self, limits: Limits, budget: &Budget) -> Result<(), CodecError> {
        let (Some(header), Some(scene)) = (&self.header, &mut self.scene) else { return Ok(()) };
        let (stream, layer) = (OpenStream::beginning(&self.bytes, header, limits), self.decoded);
        let mut heads = self.heads.clone();
        stream.add_heads(layer, &mut heads)?;
        let gaussians = stream.layer_of_gaussians_within(layer, budget)?;
        let conditions = (&scene.coordinates, &scene.feature_planes);
        let Harmonics { degree, rest, coding } =
            stream.sh_of_layer_within(layer, &gaussians, self.first_coding.as_ref(), conditions, budget)?;
        let gaussians = GaussianArrays { sh_degree: degree, sh_rest: rest, ..gaussians };
        if layer == 0 {
            scene.gaussians = gaussians;
            check(scene, &limits)?;
            self.first_coding = coding;
        } else {
            check_layer(&gaussians, &limits)?;
            append_within(&mut scene.gaussians, gaussians, budget)?;
        }
        self.heads = heads;
        self.decoded += 1;
        Ok(())
    }
}
