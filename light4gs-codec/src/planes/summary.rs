//! What a stream says of its planes besides their values.

use super::{head::Head, section::PlaneBytes};
use crate::{CodecError, ContextModelArrays, FeaturePlaneArrays, PerGroup};

/// All of a stream's planes but the values.
#[derive(Clone, Debug)]
pub(crate) struct Summary {
    pub(crate) head: Head,
    /// Bytes of each plane, in the order of the planes; empty where they are float32.
    pub(crate) bytes: Vec<PlaneBytes>,
    /// Quantization steps, one entry for all scales or one for each; empty where planes are float32.
    pub(crate) steps: Vec<PerGroup>,
    /// The description of the context model, where planes are coded with one.
    pub(crate) model: Option<ContextModelArrays>,
}

impl Summary {
    /// That of planes that are float32.
    pub(crate) fn explicit(head: Head) -> Self {
        Self { head, bytes: Vec::new(), steps: Vec::new(), model: None }
    }

    /// As [`Summary::explicit`].
    ///
    /// # Errors
    /// Planes that are out of order.
    pub(crate) fn of_explicit(planes: &FeaturePlaneArrays) -> Result<Self, CodecError> {
        Head::of(planes).map(Self::explicit)
    }
}
