//! Splatting on a GPU: the stages of `shaders/` in their order.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::features::Plane;
use cubecl::server::Handle;

use super::context::{Gpu, Parts, buffer_of, first_words};
use super::error::GpuError;
use super::kernel::Launch;
use super::sort::{Sorted, bits_for, prefix_sum, ranges, sort};
use super::stages::{
    CELL_COUNTS, COLOR, INTERSECT, PROJECT, PROJECT_BACKWARD, RASTERIZE, RASTERIZE_BACKWARD, TEAM_SUBGROUP,
    TEAM_WORKGROUP,
};
use crate::cpu::project::{FRUSTUM_MARGIN, TILE, View};
use crate::cpu::rasterize::CHANNELS;
use crate::ops::splat::{SplatInputs, SplatKernels, SplatOutputs, SplatView};

/// Intersections of a cell that one launch blends: PART in `shaders/include/constants.wgsl`.
const PART: usize = 32768;
/// Values of an intersection's sums.
const SUMS: usize = 10;
/// Cells that a Gaussian may touch on Mesa's software driver, which leaves any loop after 65535 rounds.
const MAX_CELLS_IN_SOFTWARE: u32 = 60_000;

/// Who blends a cell: a team of invocations, and how its members meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Team {
    pub(super) members: u32,
    pub(super) subgroup: bool,
    /// Side of the cell in pixels.
    pub(super) cell: u32,
}

impl Team {
    /// A team is a subgroup where their size is known: eight lanes blend 8×8 pixels, 32 lanes 16×16, so that each has
    /// eight pixels, which a fetched splat then serves.
    fn choose(gpu: &Gpu, width: u32, height: u32) -> Result<Self, GpuError> {
        let properties = gpu.client.properties();
        let (smallest, largest) = (properties.hardware.plane_size_min, properties.hardware.plane_size_max);
        let known = properties.features.plane.contains(Plane::Ops) && smallest == largest;
        let cells = |side: u32| width.div_ceil(side) * height.div_ceil(side);
        let team = match smallest {
            8 | 16 if known && cells(8) <= MAX_CELLS_IN_SOFTWARE => Self { members: smallest, subgroup: true, cell: 8 },
            16 | 32 | 64 if known => Self { members: smallest, subgroup: true, cell: 16 },
            _ => Self { members: 32, subgroup: false, cell: 16 },
        };
        if smallest == 8 && cells(team.cell) > MAX_CELLS_IN_SOFTWARE {
            return Err(GpuError::Picture { width, height, limit: MAX_CELLS_IN_SOFTWARE });
        }
        Ok(team)
    }

    fn launch<'a>(&self, gpu: &'a Gpu, stage: super::stages::Stage) -> Launch<'a> {
        Launch::new(&gpu.client, stage)
            .team(self.members, if self.subgroup { TEAM_SUBGROUP } else { TEAM_WORKGROUP })
            .constant("CELL", self.cell)
    }
}

/// What the stages of one picture have in common.
#[derive(Clone, Copy, Debug)]
struct Frame {
    view: View,
    team: Team,
    gaussians: usize,
    /// Coefficients of `sh_rest` a Gaussian.
    rest: usize,
}

impl Frame {
    fn size(&self) -> [u32; 2] {
        [self.view.camera.width, self.view.camera.height]
    }

    fn pixels(&self) -> usize {
        self.size().iter().map(|side| *side as usize).product()
    }

    fn cells(&self) -> usize {
        self.size().iter().map(|side| side.div_ceil(self.team.cell) as usize).product()
    }

    /// `View` of `shaders/include/view.wgsl`. `part` of the cells' lists, of `parts`.
    fn uniform(&self, part: usize, parts: usize) -> Vec<u32> {
        let camera = &self.view.camera;
        let [width, height] = self.size();
        let (tan_x, tan_y) = camera.tan_half_fov();
        let limits = [FRUSTUM_MARGIN * tan_x, FRUSTUM_MARGIN * tan_y, 0.5 * width as f32, 0.5 * height as f32];
        let rotation = &camera.rotation;
        let floats = [
            rotation.x_axis.extend(camera.fx).to_array(),
            rotation.y_axis.extend(camera.fy).to_array(),
            rotation.z_axis.extend(camera.cx).to_array(),
            camera.translation.extend(camera.cy).to_array(),
            camera.center().extend(0.0).to_array(),
            glam::Vec3::from_array(self.view.background).extend(0.0).to_array(),
            limits,
        ];
        let side = self.team.cell;
        let words = [
            [width, height, width.div_ceil(TILE as u32), height.div_ceil(TILE as u32)],
            [width.div_ceil(side), height.div_ceil(side), part as u32, u32::from(part + 1 == parts)],
            [self.gaussians as u32, self.view.sh_degree as u32, self.rest as u32, 0],
        ];
        floats.iter().flatten().map(|value| value.to_bits()).chain(words.into_iter().flatten()).collect()
    }

    /// Launches that the longest possible list takes: no Gaussian is in a cell's list twice.
    fn parts(&self, intersections: usize) -> usize {
        intersections.min(self.gaussians).div_ceil(PART).max(1)
    }
}

/// The buffers of the inputs, in their order.
#[derive(Clone, Debug)]
struct InputBuffers {
    means: Handle,
    quats: Handle,
    scales: Handle,
    opacities: Handle,
    sh_dc: Handle,
    sh_rest: Handle,
    screen_offsets: Handle,
}

/// Gaussians on the screen, and which of them touches which cell.
#[derive(Clone, Debug)]
struct Intersections {
    splats: Handle,
    /// Number of all intersections.
    count: usize,
    /// `[N]`: the first intersection of each Gaussian; the others follow it.
    first_of_gaussian: Handle,
    /// `[count]`: the Gaussian of each intersection.
    gaussians: Handle,
    /// `[count]`: intersections cell by cell, nearest first.
    order: Handle,
    /// `[cells + 1]`: where each cell begins in `order`.
    starts: Handle,
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuSplatSaved {
    frame: Frame,
    shapes: [Shape; 7],
    inputs: InputBuffers,
    intersections: Intersections,
    picture: Handle,
}

fn project(gpu: &Gpu, frame: &Frame, inputs: &InputBuffers) -> Result<[Handle; 3], GpuError> {
    let count = frame.gaussians;
    let splats = gpu.allocate("splats", 16 * count)?;
    let depth_keys = gpu.allocate("depths", count)?;
    let radii = gpu.allocate("radii", count)?;
    let uniform = frame.uniform(0, 1);
    Launch::new(&gpu.client, COLOR)
        .reads(&inputs.means)
        .reads(&inputs.sh_dc)
        .reads(&inputs.sh_rest)
        .writes(&splats)
        .uniform(&uniform)
        .invocations(count)?;
    Launch::new(&gpu.client, PROJECT)
        .constant("CELL", frame.team.cell)
        .reads(&inputs.means)
        .reads(&inputs.quats)
        .reads(&inputs.scales)
        .reads(&inputs.opacities)
        .reads(&inputs.screen_offsets)
        .updates(&splats)
        .writes(&depth_keys)
        .writes(&radii)
        .uniform(&uniform)
        .invocations(count)?;
    Ok([splats, depth_keys, radii])
}

fn intersect(gpu: &Gpu, frame: &Frame, splats: Handle, depth_keys: &Handle) -> Result<Intersections, GpuError> {
    let gaussian_count = frame.gaussians;
    let by_depth = sort(gpu, depth_keys, gaussian_count, 32)?.order;
    let first_places = gpu.allocate("places of intersections", gaussian_count)?;
    Launch::new(&gpu.client, CELL_COUNTS)
        .reads(&by_depth)
        .reads(&splats)
        .writes(&first_places)
        .uniform(&[gaussian_count as u32])
        .invocations(gaussian_count)?;
    let total = prefix_sum(gpu, &first_places, gaussian_count)?;
    // The one read-back of a picture: all further buffers are made to its measure.
    let count = match gaussian_count {
        0 => 0,
        _ => gpu.read_word("the number of intersections", &total)? as usize,
    };

    let first_of_gaussian = gpu.allocate("intersections of Gaussians", gaussian_count)?;
    let cells = gpu.allocate("cells of intersections", count)?;
    let gaussians = gpu.allocate("Gaussians of intersections", count)?;
    Launch::new(&gpu.client, INTERSECT)
        .constant("CELL", frame.team.cell)
        .reads(&by_depth)
        .reads(&first_places)
        .reads(&splats)
        .writes(&first_of_gaussian)
        .writes(&cells)
        .writes(&gaussians)
        .uniform(&frame.uniform(0, 1))
        .invocations(gaussian_count)?;
    let Sorted { keys, order } = sort(gpu, &cells, count, bits_for(frame.cells()))?;
    let starts = ranges(gpu, &keys, count, frame.cells())?;
    Ok(Intersections { splats, count, first_of_gaussian, gaussians, order, starts })
}

fn rasterize(gpu: &Gpu, frame: &Frame, lists: &Intersections) -> Result<Handle, GpuError> {
    let picture = gpu.allocate("picture", CHANNELS * frame.pixels())?;
    let parts = frame.parts(lists.count);
    for part in 0..parts {
        frame
            .team
            .launch(gpu, RASTERIZE)
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .updates_if(part > 0, &picture)
            .uniform(&frame.uniform(part, parts))
            .groups(frame.cells())?;
    }
    Ok(picture)
}

fn forward(
    inputs: SplatInputs<CubeBackend>,
    view: View,
) -> Result<(SplatOutputs<CubeBackend>, GpuSplatSaved), GpuError> {
    let gpu = Gpu::of(&inputs.means)?;
    let inputs = inputs.into_array();
    let shapes = inputs.each_ref().map(|tensor| tensor.shape());
    let frame = Frame {
        view,
        team: Team::choose(&gpu, view.camera.width, view.camera.height)?,
        gaussians: shapes[0][0],
        rest: shapes[5][1],
    };
    let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] = inputs.map(buffer_of);
    let inputs = InputBuffers { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets };
    forward_with(&gpu, frame, inputs, shapes)
}

fn forward_with(
    gpu: &Gpu,
    frame: Frame,
    inputs: InputBuffers,
    shapes: [Shape; 7],
) -> Result<(SplatOutputs<CubeBackend>, GpuSplatSaved), GpuError> {
    let [splats, depth_keys, radii] = project(gpu, &frame, &inputs)?;
    let intersections = intersect(gpu, &frame, splats, &depth_keys)?;
    let picture = rasterize(gpu, &frame, &intersections)?;
    gpu.check("the picture", &[&picture])?;
    let values = CHANNELS * frame.pixels();
    let outputs = SplatOutputs {
        picture: gpu.tensor(first_words(&picture, values), Shape::from([values])),
        radii: gpu.int_tensor(first_words(&radii, frame.gaussians), Shape::from([frame.gaussians])),
    };
    Ok((outputs, GpuSplatSaved { frame, shapes, inputs, intersections, picture }))
}

fn backward(saved: GpuSplatSaved, upstream: CubeTensor) -> Result<SplatInputs<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let upstream = buffer_of(upstream);
    let GpuSplatSaved { frame, shapes, inputs, intersections: lists, picture } = saved;
    let sums = gpu.allocate("sums of intersections", SUMS * lists.count)?;
    let parts = frame.parts(lists.count);
    let carried = gpu.allocate("pixels between parts", if parts > 1 { 2 * frame.pixels() } else { 0 })?;
    for part in 0..parts {
        frame
            .team
            .launch(&gpu, RASTERIZE_BACKWARD)
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .reads(&picture)
            .reads(&upstream)
            .writes(&sums)
            .updates_if(part > 0, &carried)
            .uniform(&frame.uniform(part, parts))
            .groups(frame.cells())?;
    }

    let layout = Parts::new(&shapes.each_ref().map(|shape| shape.num_elements()));
    let gradients = gpu.allocate("gradients of Gaussians", layout.total)?;
    let mut uniform = frame.uniform(0, 1);
    uniform.extend(layout.starts.iter().map(|start| *start as u32));
    Launch::new(&gpu.client, PROJECT_BACKWARD)
        .reads(&inputs.means)
        .reads(&inputs.quats)
        .reads(&inputs.scales)
        .reads(&inputs.sh_rest)
        .reads(&lists.splats)
        .reads(&lists.first_of_gaussian)
        .reads(&sums)
        .writes(&gradients)
        .uniform(&uniform)
        .invocations(frame.gaussians)?;
    gpu.check("the gradients of a picture", &[&gradients])?;
    let mut k = 0;
    Ok(SplatInputs::from_array(shapes.map(|shape| {
        k += 1;
        gpu.tensor(layout.of(&gradients, k - 1), shape)
    })))
}

impl SplatKernels for CubeBackend {
    type Saved = GpuSplatSaved;

    fn splat_forward(inputs: SplatInputs<Self>, SplatView(view): SplatView) -> (SplatOutputs<Self>, GpuSplatSaved) {
        forward(inputs, view).unwrap_or_else(|error| error.raise())
    }

    fn splat_backward(saved: GpuSplatSaved, gradient: CubeTensor) -> SplatInputs<Self> {
        backward(saved, gradient).unwrap_or_else(|error| error.raise())
    }
}
