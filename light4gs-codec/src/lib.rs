//! The `.l4gs` stream: plain arrays in, bytes out, and back, bit for bit, on every machine.
//!
//! A dynamic scene is a set of Gaussians, scene coordinates that normalize their positions, multiscale feature planes and a
//! small deformation network. [`SceneData`] holds all of it as plain arrays. `docs/format.md` describes the stream byte
//! by byte.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | read a scene | [`decode`] for bytes, `read_file` for a file |
//! | know what a file holds, without decoding it | [`info`], `read_info` |
//! | write a scene without loss | [`encode`] |
//! | write a small file | [`encode_compressed`] with a [`CompressionInput`] |
//! | know beforehand whether the encoder accepts a scene | [`checks`] |
//! | have the Gaussians at many times | [`MotionEvaluator`]; for images see the crate `light4gs-render` |
//! | show a file while it comes | [`StreamDecoder`] |
//! | read or write minutes in one file, a take | [`take`] |
//! | read one section, or one layer of Gaussians | [`OpenStream`] |
//! | accept files of strangers | nothing: the default [`Limits`] are for these. [`Limits::large`] is for your own |
//! | describe a network to the codec | [`network`] |
//! | name the planes of a field | [`plane_layout`] |
//!
//! **In short:** [`encode`] and [`decode`] suffice for most programs. Training needs [`encode_compressed`] too, and a player
//! [`StreamDecoder`] and [`MotionEvaluator`].
//!
//! # Example
//!
//! ```
//! use light4gs_codec::{GaussianArrays, SceneCoordinateArrays, SceneData, SceneMeta, decode, encode, info};
//!
//! let scene = SceneData {
//!     meta: SceneMeta { name: "one gray ball".into(), frame_count: 1, fps: 30.0, ..Default::default() },
//!     gaussians: GaussianArrays {
//!         means: vec![[0.0, 0.5, 2.0]],
//!         log_scales: vec![[-3.0; 3]],
//!         quats: vec![[1.0, 0.0, 0.0, 0.0]],
//!         opacity_logits: vec![2.0],
//!         sh_dc: vec![[0.1; 3]],
//!         sh_degree: 1,
//!         sh_rest: vec![0.0; 9],
//!         further: Vec::new(),
//!     },
//!     coordinates: SceneCoordinateArrays::default(), // no normalization
//!     ..Default::default()                // no planes, no network: a scene that does not move
//! };
//!
//! let bytes = encode(&scene)?;
//! assert_eq!(decode(&bytes)?, scene);
//! assert_eq!(info(&bytes)?.gaussian_count, 1);
//! assert_eq!(scene.positions_at(0.5)?, [[0.0, 0.5, 2.0]]); // half-way through the time
//!
//! // Damage is found, and named.
//! let mut damaged = bytes.clone();
//! *damaged.last_mut().unwrap() ^= 1;
//! assert!(decode(&damaged).unwrap_err().to_string().contains("checksum"));
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! # Compression
//!
//! [`encode_compressed`] quantizes a scene and codes it under learned distributions:
//!
//! - planes under a [context model](ContextModelArrays),
//! - spherical harmonics under [tables or small networks](ShCoding),
//! - the other [`attributes`] and the [weights of networks](network_weights) adaptively.
//!
//! A coding interval must be the same in the encoder and in every decoder. So an executor of this crate evaluates the networks
//! that give the intervals, in plain float32 arithmetic of a fixed order. The stream holds the networks as
//! [descriptions](network), so a model may compose its networks freely. The encoder decodes its own bytes and compares
//! before it returns. It returns all that it knows: the stream, the decoded scene and the bytes of each part ([`Encoded`]).
//!
//! [`decode`] reads all streams alike. [`OpenStream`] reads a stream section by section, or all of it once, together with what
//! [`info`] tells.
//!
//! # Limits
//!
//! A reader trusts nothing: every length and every count is checked against the bytes that are there and against
//! [`Limits`] before memory or time is taken. Hostile input gets a [`CodecError`], never a panic. `SECURITY.md` has the
//! promises.
//!
//! [`encode`], [`encode_compressed`], [`decode`] and [`info`] use no files and compile for `wasm32-unknown-unknown`. There
//! `read_file`, `read_file_and`, `read_info` and `read_stream` are absent, and one thread does all work. Elsewhere the threads of rayon's
//! current pool code the planes; the bytes do not depend on their number.
#![forbid(unsafe_code)]

mod adaptive;
pub mod attributes;
mod budget;
mod bytes;
pub mod checks;
mod entropy;
mod error;
mod fields;
#[cfg(not(target_os = "unknown"))]
mod file;
mod format;
mod limits;
mod motion;
pub mod network;
mod parallel;
pub mod plane_layout;
mod planes;
pub mod rendering;
mod scene;
mod sh;
mod steps;
mod stream;
pub mod take;
mod vectors;

pub use budget::Demand;
pub use bytes::{
    names::legal_name,
    sections::{Encoding, Kind},
};
pub use entropy::{Distributions, FrequencyTable};
pub use error::CodecError;
#[cfg(not(target_os = "unknown"))]
pub use file::{read_file, read_file_and, read_file_with_limits, read_info, read_info_with_limits, read_stream};
pub use format::{MAGIC, TAKE_MAGIC, VERSION};
pub use limits::Limits;
pub use motion::MotionEvaluator;
pub use network::{Network, weights as network_weights};
pub use planes::{
    Condition, ContextModelArrays, LatentArrays, PlaneCoding, PlanePrior, PlaneSource, section::PlaneBytes,
};
pub use scene::{
    AttributeValues, Coder, CoordinateMapping, FeaturePlaneArrays, FurtherAttribute, GaussianArrays,
    LONGEST_ATTRIBUTE_NAME, MotionArrays, MotionNetwork, MotionOutput, MotionSource, NamedTensor, Plane,
    SceneCoordinateArrays, SceneData, SceneMeta, legal_attribute_name, sh_rest_coefficients,
};
pub use sh::{ShBytes, ShCoding, ShPrior, ShSource};
pub use steps::PerGroup;
pub use stream::{
    CompressionInput, Compressor, Decoded, Encoded, GaussianLayers, LayerInfo, OpenStream, Profile, SectionInfo,
    StreamDecoder, StreamInfo, WeightPrecisions, decode, decode_with_limits, encode, encode_compressed,
    encode_compressed_with_limits, encode_exactly, encode_planes, encode_sh, info, info_with_limits,
    plane_distributions, sh_distributions,
};
