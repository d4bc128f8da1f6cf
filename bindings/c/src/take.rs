//! The open take, and its Gaussians at one time.

use std::ffi::CString;

use light4gs_codec::GaussianArrays;
use light4gs_render::PlayableTake;

use crate::failure::c_string;

/// An open take. Nothing that can be asked of it changes until it is closed.
#[derive(Debug)]
pub struct L4gsTake {
    pub(crate) playable: PlayableTake,
    pub(crate) name: CString,
    /// Key and value.
    pub(crate) extras: Vec<(CString, CString)>,
}

impl L4gsTake {
    /// `kept` is the most segments that are kept decoded, at least two; 0 for the number that the library chooses.
    pub(crate) fn new(playable: PlayableTake, kept: u32) -> Self {
        let playable = if kept == 0 { playable } else { playable.keeping(kept as usize) };
        let meta = playable.take().meta();
        let name = c_string(&meta.name);
        let extras = meta.extra.iter().map(|(key, value)| (c_string(key), c_string(value))).collect();
        Self { name, extras, playable }
    }
}

/// The Gaussians of a take at one time. They do not change until they are closed.
#[derive(Debug)]
pub struct L4gsGaussians(pub(crate) GaussianArrays);

// Several threads may use one take, and the same Gaussians.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    shared::<L4gsTake>();
    shared::<L4gsGaussians>();
};

#[cfg(test)]
mod tests {
    use light4gs_codec::Limits;

    use super::*;

    #[test]
    fn as_many_segments_are_kept_as_the_caller_says() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/conformance/streams/takes/appended.l4gs");
        for (kept, decoded) in [(0, vec![0, 1, 2]), (1, vec![1, 2]), (2, vec![1, 2]), (3, vec![0, 1, 2])] {
            let playable = PlayableTake::open(path.as_ref(), &Limits::default()).expect("a take");
            let take = L4gsTake::new(playable, kept);
            [0.05, 0.31, 1.5].iter().for_each(|&seconds| take.playable.prepare(seconds).expect("a segment"));
            assert_eq!(take.playable.decoded(), decoded, "{kept}");
        }
    }
}
