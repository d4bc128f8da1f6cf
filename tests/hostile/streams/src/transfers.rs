//! Streams that come in pieces: cut anywhere, resumed anywhere, damaged on the way.
//! Whatever happens, the result is an error or the right picture: shown layers are those of the file that was sent, and
//! a complete stream gives the scene of [`decode`].

use light4gs_codec::{CodecError, SceneData, StreamDecoder, decode};

use crate::{
    mutations,
    parts::Parts,
    random::Random,
    sound,
    watch::{Decoder, Outcome},
};

/// The bytes that a decoder gets, in pieces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// How it was made.
    pub kind: &'static str,
    /// The pieces in order, and whether each is decoded at once.
    pub pieces: Vec<(Vec<u8>, bool)>,
    /// Which file was sent; none where the sender lies.
    file: Option<usize>,
}

impl Transfer {
    /// All bytes that come.
    pub fn bytes(&self) -> Vec<u8> {
        self.pieces.iter().flat_map(|(piece, _)| piece).copied().collect()
    }
}

/// Makes transfers.
#[derive(Debug)]
pub struct Transfers {
    files: Vec<(Vec<u8>, SceneData)>,
    seed: u64,
}

impl Transfers {
    /// The transfers of a seed.
    ///
    /// # Panics
    /// If a sound stream is refused.
    pub fn new(seed: u64) -> Self {
        let files = sound::streams().into_iter().map(|parts| {
            let bytes = parts.assemble();
            let scene = decode(&bytes).expect("sound");
            (bytes, scene)
        });
        Self { files: files.collect(), seed }
    }

    /// Transfer `number`.
    pub fn transfer(&self, number: u64) -> Transfer {
        let mut random = Random::new(self.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let index = random.below(self.files.len());
        let bytes = &self.files[index].0;
        let mut file = Some(index);
        let cut = random.below(bytes.len() + 1);
        let other = random.below(bytes.len() + 1);
        let (kind, sent) = match random.below(10) {
            0 => ("whole", bytes.clone()),
            1 => ("cut", bytes[..cut].to_vec()),
            2 => ("resumed too late", [&bytes[..cut.min(other)], &bytes[cut.max(other)..]].concat()),
            3 => ("resumed too early", [&bytes[..cut.max(other)], &bytes[cut.min(other)..]].concat()),
            4 => {
                let from = &self.files[random.below(self.files.len())].0;
                ("resumed in another file", [&bytes[..cut], &from[cut.min(from.len())..]].concat())
            }
            5 => ("cut and resumed many times", resumed_often(bytes, &mut random)),
            6 => {
                let mut sent = bytes.clone();
                mutations::flip(&mut sent, &mut random);
                ("flipped", sent)
            }
            7 => ("something else after the cut", [&bytes[..cut], &random.bytes(bytes.len() - cut)].concat()),
            lie => {
                file = None;
                let mut parts = Parts::of(bytes);
                let all: Vec<_> = self.files.iter().map(|(bytes, _)| Parts::of(bytes)).collect();
                if lie == 8 {
                    let (a, b) = (random.below(parts.sections.len()), random.below(parts.sections.len()));
                    parts.sections.swap(a, b);
                } else {
                    for _ in 0..1 + random.below(3) {
                        mutations::mutate(&mut parts, &all, &mut random);
                    }
                }
                (if lie == 8 { "sections in another order" } else { "changed, with checksums" }, parts.assemble())
            }
        };
        Transfer { kind, pieces: pieces(&sent, &mut random), file }
    }

    /// Decodes the pieces as they come.
    pub fn run(&self, transfer: &Transfer, decoder: &Decoder) -> Outcome {
        let whole = decode(&transfer.bytes());
        let sent = transfer.file.map(|file| &self.files[file].1);
        let mut wrong = None;
        let mut outcome = decoder.watch(|| {
            let answer = receive(&transfer.pieces, |shown| {
                // A file that is cut before its first byte may become another one.
                let all = [sent, whole.as_ref().ok()];
                let right = all == [None; 2] || all.iter().flatten().any(|right| is_part_of(shown, right));
                wrong = wrong.or((!right).then_some("wrong picture"));
            });
            match (&answer, &whole) {
                (Ok(scene), Ok(whole)) if scene == whole => {}
                (Err(_), Err(_)) => {}
                _ => wrong = Some("another answer than for the whole"),
            }
            answer.map(drop)
        });
        outcome.wrong = wrong;
        outcome
    }
}

fn receive(pieces: &[(Vec<u8>, bool)], mut show: impl FnMut(&SceneData)) -> Result<SceneData, CodecError> {
    let mut decoder = StreamDecoder::new();
    for (piece, now) in pieces {
        decoder.push(piece)?;
        if *now && decoder.decode()? > 0 {
            decoder.scene().into_iter().for_each(&mut show);
        }
    }
    decoder.finish()
}

/// Whether a scene is the `whole` one as far as its Gaussians go.
fn is_part_of(scene: &SceneData, whole: &SceneData) -> bool {
    let attributes = scene.gaussians.attributes().zip(whole.gaussians.attributes());
    let begins = attributes.into_iter().all(|(part, all)| part.name == all.name && all.values.starts_with(part.values));
    let shared = (&scene.meta, &scene.coordinates, &scene.motion) == (&whole.meta, &whole.coordinates, &whole.motion);
    begins && shared && scene.feature_planes == whole.feature_planes
}

/// Bytes from many connections, each of which begins where the one before ended, or somewhere else now and then.
fn resumed_often(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let (mut sent, mut at) = (Vec::new(), 0);
    let faulty = random.chance(2);
    while at < bytes.len() {
        let end = (at + random.scale(1 << 11) as usize).min(bytes.len());
        sent.extend_from_slice(&bytes[at..end]);
        let near = end.saturating_sub(8) + random.below(17);
        at = if faulty && random.chance(8) { near.max(at + 1) } else { end };
    }
    sent
}

/// Some bytes in pieces of any length; the last piece is decoded at once.
fn pieces(bytes: &[u8], random: &mut Random) -> Vec<(Vec<u8>, bool)> {
    let most = random.pick(&[16, 1 << 9, 1 << 13, 1 << 20]);
    let often = random.pick(&[1, 2, 9]);
    let mut pieces = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (piece, others) = rest.split_at((random.scale(most) as usize).min(rest.len()));
        pieces.push((piece.to_vec(), others.is_empty() || random.chance(often)));
        rest = others;
    }
    pieces
}
