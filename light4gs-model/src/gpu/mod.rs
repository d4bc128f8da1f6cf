//! The shared code of the operations on the wgpu back end, the host side of the WGSL in `shaders/`: devices and buffers, kernels and
//! their launches, sorting, teams of invocations.
//!
//! Public are kernels as text ([`Kernel`]; [`ops::kernels`](crate::ops::kernels) has all of them) and launches as data ([`record`]),
//! so that compilers and adapters other than those of this machine can be tried: `.ci/webgpu` does; and the number of launches
//! ([`LaunchCounter`]).

mod arena;
mod context;
mod counting;
mod elementwise;
mod kernel;
mod launch;
mod recording;
pub(crate) mod sort;
mod subgroups;
mod team;

pub(crate) use arena::{Arena, PACKED_BUFFERS, batches};
#[cfg(test)]
pub(crate) use context::tests::default_gpu;
pub(crate) use context::{Gpu, PLACE_ALIGNMENT, Places, buffer_of, first_words};
pub use counting::{LaunchCounter, LaunchCounts};
pub(crate) use elementwise::elementwise;
pub use kernel::Kernel;
pub(crate) use launch::Launch;
pub use recording::{RecordedBuffer, RecordedLaunch, record};
pub(crate) use subgroups::choose_team;
pub use team::{Communication, Team, with_team};

/// The kernels that several operations launch.
pub(crate) fn kernels() -> Vec<Kernel> {
    [arena::kernels(), sort::kernels(), subgroups::kernels()].concat()
}
