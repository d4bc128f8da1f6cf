//! Which Gaussians of the base are not drawn during a segment: a bit for each.

use super::SECTION;
use crate::{
    CodecError,
    adaptive::{AdaptiveBit, BitCoder, BitDecoder, BitEncoder},
};

/// Bits before a bit that are its context. Neighbors in the order of a stream are neighbors in space, and are mostly hidden
/// together.
const CONTEXT_BITS: u32 = 6;

/// The most bytes of a list for so many Gaussians. A bit takes at most 11 bits, and the end of the coder some bytes.
pub(super) fn most_bytes(gaussians: u32) -> u64 {
    2 * u64::from(gaussians) + 16
}

/// Codes the bits, in either direction.
fn code(coder: &mut impl BitCoder, hidden: &mut [bool]) {
    let mut bits = [AdaptiveBit::default(); 1 << CONTEXT_BITS];
    let mut context = 0;
    for bit in hidden {
        *bit = bits[context].code(coder, *bit);
        context = (context << 1 | usize::from(*bit)) % bits.len();
    }
}

/// The bytes of a list; none where nothing is hidden.
pub(super) fn write(hidden: &[bool]) -> Vec<u8> {
    if !hidden.contains(&true) {
        return Vec::new();
    }
    let mut encoder = BitEncoder::default();
    code(&mut encoder, &mut hidden.to_vec());
    encoder.finish()
}

/// A bit for each of `gaussians`; no bits where there are no bytes, which is where nothing is hidden.
pub(super) fn read(bytes: &[u8], gaussians: u32) -> Result<Vec<bool>, CodecError> {
    if bytes.is_empty() {
        return Ok(Vec::new());
    }
    let mut hidden = vec![false; gaussians as usize];
    let mut decoder = BitDecoder::new(bytes);
    code(&mut decoder, &mut hidden);
    let damaged = |_| CodecError::invalid(SECTION, "hidden list", "cut short", "a bit for each Gaussian of the base");
    decoder.check().map_err(damaged)?;
    Ok(hidden)
}
