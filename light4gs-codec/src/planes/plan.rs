//! What each plane is coded from, and when.

use crate::{ContextModelShape, sections::hexplanes::AXES};

/// Planes of a scale that hold no time: xy, xz, yz.
const SPACE_ONLY: [usize; 3] = [0, 1, 3];
/// Planes over an axis and time: xt, yt, zt.
const SPACE_TIME: [usize; 3] = [2, 4, 5];

/// What a plane's entropy parameters come from, besides its own anchors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Nothing: one distribution a channel, through the biases.
    Nothing,
    /// The hyperprior.
    Hyperprior,
    /// Two planes over time of the same scale: that over the first axis, that over the second.
    TimePlanes([usize; 2]),
    /// The same plane one scale below.
    LowerScale(usize),
    /// The hyperprior, and the same plane one scale below.
    HyperpriorAndLowerScale(usize),
}

/// How a plane is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PlanePlan {
    /// Whether one of its axes is time.
    pub(crate) space_time: bool,
    pub(crate) scale: usize,
    pub(crate) source: Source,
    /// Whether anchors come first, in a sub-stream of their own.
    pub(crate) checkerboard: bool,
}

impl PlanePlan {
    pub(crate) fn has_hyperprior(&self) -> bool {
        matches!(self.source, Source::Hyperprior | Source::HyperpriorAndLowerScale(_))
    }

    /// Sub-streams of the plane: the hyperprior's, the anchors', that of the others.
    pub(crate) fn sub_streams(&self) -> usize {
        1 + usize::from(self.has_hyperprior()) + usize::from(self.checkerboard)
    }
}

/// The plan of every plane, in the order of [`crate::HexPlaneArrays::planes`].
pub(crate) fn plan(shape: &ContextModelShape, scales: usize) -> Vec<PlanePlan> {
    (0..6 * scales)
        .map(|index| {
            let (scale, kind) = (index / 6, index % 6);
            let space_time = SPACE_TIME.contains(&kind);
            let parts = shape.parts;
            let source = if scale > 0 && parts.inter_scale {
                let lower = index - 6;
                if parts.high_scale_hyperprior {
                    Source::HyperpriorAndLowerScale(lower)
                } else {
                    Source::LowerScale(lower)
                }
            } else if !space_time && parts.inter_plane {
                let (first, second) = AXES[kind];
                Source::TimePlanes([first, second].map(|axis| 6 * scale + SPACE_TIME[axis]))
            } else if parts.hyperprior {
                Source::Hyperprior
            } else {
                Source::Nothing
            };
            let alone = !matches!(source, Source::LowerScale(_) | Source::HyperpriorAndLowerScale(_));
            PlanePlan { space_time, scale, source, checkerboard: parts.checkerboard && alone }
        })
        .collect()
}

/// The order in which planes are coded: those of a stage need only planes of the stages before.
pub(super) fn stages(scales: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..scales).flat_map(|scale| [SPACE_TIME, SPACE_ONLY].map(|stage| stage.map(|kind| 6 * scale + kind)))
}
