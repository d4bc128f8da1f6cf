//! Teams of invocations, each of which blends a cell of the image.

use std::cell::Cell;

use light4gs_shaders::team::{AGREED, SUBGROUP, SUM_OF_FEW, SUM_OF_MANY, TRUSTED, WORKGROUP};

/// How the members of a team communicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Communication {
    /// Through workgroup memory, on every adapter.
    WorkgroupMemory,
    /// Through subgroup operations; sums are taken member by member, which is best for small teams.
    SubgroupOfFew,
    /// Through subgroup operations; sums are taken by halves, which is best for large teams.
    SubgroupOfMany,
    /// As [`Communication::SubgroupOfFew`], for Mesa's software driver, on which a barrier takes long. The kernel omits the
    /// proof for the compiler that control flow is uniform in a subgroup. Browsers take it only after `diagnostic(off,
    /// subgroup_uniformity);`.
    SubgroupOfMesa,
}

impl Communication {
    /// Its files in `shaders/team`.
    pub(super) fn includes(self) -> &'static [&'static str] {
        match self {
            Self::WorkgroupMemory => &[AGREED, WORKGROUP],
            Self::SubgroupOfFew => &[AGREED, SUBGROUP, SUM_OF_FEW],
            Self::SubgroupOfMesa => &[TRUSTED, SUBGROUP, SUM_OF_FEW],
            Self::SubgroupOfMany => &[AGREED, SUBGROUP, SUM_OF_MANY],
        }
    }
}

/// The team of invocations, a workgroup, that blends a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Team {
    /// Invocations.
    pub members: u32,
    /// How they communicate.
    pub communication: Communication,
    /// Side of the cell in pixels. `cell² / members` is a multiple of four, and `members` one of `cell`.
    pub cell: u32,
}

impl Team {
    /// The team for adapters whose subgroups have no fixed size, or one that is not in [`Team::OF_SUBGROUPS`].
    pub const WITHOUT_SUBGROUPS: Self = Self { members: 32, communication: Communication::WorkgroupMemory, cell: 16 };

    /// The teams that are one subgroup. Eight lanes blend 8×8 pixels, 32 lanes 16×16: so each lane has eight pixels,
    /// which share the splat that it fetches.
    pub const OF_SUBGROUPS: [Self; 4] = [
        Self { members: 8, communication: Communication::SubgroupOfFew, cell: 8 },
        Self { members: 16, communication: Communication::SubgroupOfMany, cell: 16 },
        Self { members: 32, communication: Communication::SubgroupOfMany, cell: 16 },
        Self { members: 64, communication: Communication::SubgroupOfMany, cell: 16 },
    ];

    /// The team for Mesa's software driver with subgroups of eight.
    pub const OF_MESA: Self = Self { members: 8, communication: Communication::SubgroupOfMesa, cell: 8 };

    /// Every team that this program can choose.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::OF_SUBGROUPS.into_iter().chain([Self::OF_MESA, Self::WITHOUT_SUBGROUPS])
    }

    /// Sides of the cells of [`Team::all`], each once.
    pub(crate) fn cells() -> Vec<u32> {
        let mut cells: Vec<u32> = Self::all().map(|team| team.cell).collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    }
}

thread_local! {
    static WANTED: Cell<Option<Team>> = const { Cell::new(None) };
}

/// The team that [`with_team`] asks for.
pub(super) fn wanted() -> Option<Team> {
    WANTED.get()
}

/// Runs operations, whose images on this thread are blended by this team and not by the one that suits the adapter: for
/// checks of teams that the adapter would not choose. On an adapter that cannot run the team, the image is undefined.
pub fn with_team<R>(team: Team, run: impl FnOnce() -> R) -> R {
    let before = WANTED.replace(Some(team));
    let result = run();
    WANTED.set(before);
    result
}
