//! Takes: captures of minutes, trained as a base that stands still and segments in time.
//!
//! The *base* has what stands still over the whole take, and is trained like any scene without motion, from few times. Each
//! *segment* has what moves in a few seconds, and is an ordinary run whose images show the base behind it (`model.base`,
//! `data.between`). So segments can be trained in any order and on many machines.
//!
//! | file | contents |
//! |---|---|
//! | `base` | the base behind a segment |
//! | `hidden` | Gaussians of the base that a segment hides: what stood there and has gone |
//! | `residual` | where the images of a segment differ from its base |
//! | `start` | where a segment's own Gaussians begin: at what the base does not explain |
//! | `cuts` | where the picture changes at once |
//! | `plan` | the segments of a take |
//! | `growth` | how much more a take sees than a segment |
//! | `folder` | the runs of a take, and the file that they give |
//! | `evaluation` | quality by frame, at joins and elsewhere; flicker |

mod base;
mod cuts;
mod evaluation;
mod folder;
mod growth;
mod hidden;
mod plan;
mod residual;
mod start;

pub use base::{Base, HIDDEN, backdrop_of};
pub use cuts::cuts;
pub use evaluation::{JoinScores, TakeEvaluation, TakeFrame, evaluate_take, render_take};
pub use folder::{SEGMENT_SHARE, TakeFolder, TakeRecord};
pub use plan::{PlannedSegment, SegmentLength, TakePlan};
pub use start::Start;
