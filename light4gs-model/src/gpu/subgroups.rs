//! Which team suits an adapter.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use cubecl::device::DeviceId;
use light4gs_shaders::SUBGROUPS;

use super::context::Gpu;
use super::kernel::Kernel;
use super::launch::Launch;
use super::team::{Team, wanted};
use crate::gpu_error::GpuError;

/// The kernel that asks an adapter.
fn question(size: u32) -> Kernel {
    Kernel::new(SUBGROUPS).workgroup(size)
}

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    Team::OF_SUBGROUPS.into_iter().map(|team| question(team.members)).collect()
}

/// A team is a subgroup if the size of subgroups is known.
pub(crate) fn choose_team(gpu: &Gpu, width: u32, height: u32) -> Result<Team, GpuError> {
    let cells = |team: Team| width.div_ceil(team.cell) * height.div_ceil(team.cell);
    // A Gaussian visits the cells that it touches in one loop.
    let limit = gpu.longest_loop() as u32;
    let team = match (wanted(), team_of_subgroups(gpu)?) {
        (Some(team), _) => team,
        (None, Some(team)) if cells(team) <= limit => team,
        _ => Team::WITHOUT_SUBGROUPS,
    };
    if cells(team) > limit {
        return Err(GpuError::Image { width, height, limit });
    }
    Ok(team)
}

/// The result for each device.
static FOUND: LazyLock<Mutex<HashMap<DeviceId, Option<Team>>>> = LazyLock::new(Mutex::default);

/// The team that is a subgroup, if a workgroup of the subgroups' size is one subgroup; found by an experiment.
fn team_of_subgroups(gpu: &Gpu) -> Result<Option<Team>, GpuError> {
    let mut found = FOUND.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let device = gpu.client.service_id().device;
    if let Some(known) = found.get(&device) {
        return Ok(*known);
    }
    let hardware = &gpu.client.properties().hardware;
    let size = hardware.plane_size_min;
    let mut team = Team::OF_SUBGROUPS.into_iter().find(|team| team.members == size && size == hardware.plane_size_max);
    if team.is_some() {
        let counted = gpu.allocate("size of subgroups", 1)?;
        let launched = Launch::new(&gpu.client, question(size)).writes(&counted).groups(1);
        if launched.is_err() || gpu.read_word("the size of subgroups", &counted)? != size {
            team = None;
        }
    }
    if team.is_some_and(|team| team.members == Team::OF_MESA.members) && gpu.is_mesas_software() {
        team = Some(Team::OF_MESA);
    }
    found.insert(device, team);
    Ok(team)
}
