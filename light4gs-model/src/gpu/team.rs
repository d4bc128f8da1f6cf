//! Teams of invocations, each of which blends a cell of the image.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use cubecl::device::DeviceId;
use light4gs_shaders::include::{TEAM_SUBGROUP, TEAM_SUM_OF_FEW, TEAM_SUM_OF_MANY, TEAM_WORKGROUP};
use light4gs_shaders::{SUBGROUPS, Shader};

use super::context::Gpu;
use super::kernel::Launch;
use crate::gpu_error::GpuError;

/// Members of a team communicate through subgroup operations; for small teams.
pub(super) const TEAM_OF_FEW: &[&str] = &[TEAM_SUBGROUP, TEAM_SUM_OF_FEW];
/// Members of a team communicate through subgroup operations; for large teams.
pub(super) const TEAM_OF_MANY: &[&str] = &[TEAM_SUBGROUP, TEAM_SUM_OF_MANY];
/// Members of a team communicate through workgroup memory.
pub(super) const TEAM_WITHOUT_SUBGROUPS: &[&str] = &[TEAM_WORKGROUP];

/// Intersections of a cell that one launch blends. Mesa's software driver ends any loop after 65535 iterations, and a
/// graphics driver may stop a launch that runs for seconds.
pub(super) const CHUNK: usize = 32768;

/// The team of invocations that blends a cell, and how its members communicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Team {
    pub(super) members: u32,
    /// The files of `shaders/include` for their communication.
    pub(super) includes: &'static [&'static str],
    /// Side of the cell in pixels.
    pub(super) cell: u32,
}

impl Team {
    /// A team is a subgroup if the size of subgroups is known: eight lanes blend 8×8 pixels, 32 lanes 16×16. So each
    /// lane has eight pixels, which share the splat that it fetches.
    pub(super) fn choose(gpu: &Gpu, width: u32, height: u32) -> Result<Self, GpuError> {
        let smallest = gpu.client.properties().hardware.plane_size_min;
        let known = has_subgroups_of_one_size(gpu)?;
        let cells = |side: u32| width.div_ceil(side) * height.div_ceil(side);
        // A Gaussian visits the cells that it touches in one loop.
        let limit = gpu.longest_loop() as u32;
        let team = match smallest {
            8 if known && cells(8) <= limit => Self { members: 8, includes: TEAM_OF_FEW, cell: 8 },
            16 | 32 | 64 if known => Self { members: smallest, includes: TEAM_OF_MANY, cell: 16 },
            _ => Self { members: 32, includes: TEAM_WITHOUT_SUBGROUPS, cell: 16 },
        };
        if cells(team.cell) > limit {
            return Err(GpuError::Image { width, height, limit });
        }
        Ok(team)
    }

    /// Begins the launch of a kernel that blends.
    pub(super) fn launch<'a>(&self, gpu: &'a Gpu, shader: Shader) -> Launch<'a> {
        Launch::new(&gpu.client, shader)
            .team(self.members, self.includes)
            .constant("CELL", self.cell)
            .constant("CHUNK", CHUNK as u32)
    }
}

/// The result for each device.
static FOUND: LazyLock<Mutex<HashMap<DeviceId, bool>>> = LazyLock::new(Mutex::default);

/// Whether a workgroup of the subgroups' size is one subgroup; found by an experiment.
fn has_subgroups_of_one_size(gpu: &Gpu) -> Result<bool, GpuError> {
    let mut found = FOUND.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let device = gpu.client.service_id().device;
    if let Some(known) = found.get(&device) {
        return Ok(*known);
    }
    let hardware = &gpu.client.properties().hardware;
    let size = hardware.plane_size_min;
    let mut known = size == hardware.plane_size_max && size > 1;
    if known {
        let counted = gpu.allocate("size of subgroups", 1)?;
        let launched = Launch::new(&gpu.client, SUBGROUPS).workgroup(size).writes(&counted).groups(1);
        known = launched.is_ok() && gpu.read_word("the size of subgroups", &counted)? == size;
    }
    found.insert(device, known);
    Ok(known)
}
