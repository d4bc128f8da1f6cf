//! Splatting on a GPU: the kernels of `shaders/` in their order.

use burn::backend::TensorMetadata;
use burn::backend::ops::FloatTensorOps;
use burn::tensor::Shape;
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use cubecl::server::Handle;
use light4gs_codec::rendering::TILE;
use light4gs_render::View;
use light4gs_shaders::{CELL_COUNTS, INTERSECT, PROJECT, PROJECT_BACKWARD, RASTERIZE, RASTERIZE_BACKWARD, Shader};

use super::{OfPixels, SplatInputs, SplatKernels, SplatOutputs, SplatView};
use crate::gpu::sort::{Sorted, bits_for, prefix_sum, ranges, sort};
use crate::gpu::{Arena, Gpu, Kernel, Launch, PLACE_ALIGNMENT, Places, Team, buffer_of, choose_team, first_words};
use crate::gpu_error::GpuError;
use crate::ops::activation::bound_reached;
use crate::ops::fusion::{int_leaf, leaf, resolve};
use crate::ops::sample::GpuOperation;

/// Bits of a key in the order of depths: four digits of the sort.
const DEPTH_BITS: u32 = 28;
/// Values of an intersection's sums.
const SUMS: usize = 10;

/// Values that the kernels of one image share.
#[derive(Clone, Copy, Debug)]
pub(in crate::ops) struct Frame {
    view: View,
    pub(in crate::ops) team: Team,
    pub(in crate::ops) gaussians: usize,
    /// Coefficients of `sh_rest` for each Gaussian.
    rest: usize,
    /// Intersections that there is room for; `None`: for all, as soon as they are counted.
    room: Option<usize>,
    /// Whether scales are logarithms and opacities logits.
    logarithms: bool,
    /// Splats of a cell's list that one launch blends.
    chunk: usize,
}

impl Frame {
    fn size(&self) -> [u32; 2] {
        [self.view.camera.width, self.view.camera.height]
    }

    pub(in crate::ops) fn pixels(&self) -> usize {
        self.size().iter().map(|side| *side as usize).product()
    }

    pub(in crate::ops) fn cells(&self) -> usize {
        self.size().iter().map(|side| side.div_ceil(self.team.cell) as usize).product()
    }

    /// Numbers of image, alpha and depth.
    fn values(&self) -> [usize; 3] {
        [3, 1, 1].map(|channels| channels * self.pixels())
    }

    /// `View` of `shaders/include/view.wgsl`, for chunk `chunk` of `chunks` of the cells' lists.
    pub(in crate::ops) fn uniform(&self, chunk: usize, chunks: usize) -> Vec<u32> {
        let camera = &self.view.camera;
        let [width, height] = self.size();
        let [least, most] = self.view.slope_limits();
        let rotation = &camera.rotation;
        let floats = [
            rotation.x_axis.extend(camera.fx).to_array(),
            rotation.y_axis.extend(camera.fy).to_array(),
            rotation.z_axis.extend(camera.cx).to_array(),
            camera.translation.extend(camera.cy).to_array(),
            camera.center().extend(0.0).to_array(),
            glam::Vec3::from_array(self.view.background).extend(0.0).to_array(),
            [least.x, least.y, most.x, most.y],
        ];
        let side = self.team.cell;
        let [_, alpha, depth] = Places::new(&self.values()).starts[..] else { unreachable!("three arrays") };
        let words = [
            [width, height, width.div_ceil(TILE as u32), height.div_ceil(TILE as u32)],
            [width.div_ceil(side), height.div_ceil(side), chunk as u32, u32::from(chunk + 1 == chunks)],
            [self.gaussians as u32, self.view.sh_degree as u32, self.rest as u32, self.room.unwrap_or(0) as u32],
            [alpha as u32, depth as u32, self.chunk as u32, 0],
        ];
        floats.iter().flatten().map(|value| value.to_bits()).chain(words.into_iter().flatten()).collect()
    }

    /// An error if an operation has failed on which this buffer depends. A caller that has reserved room does not wait here:
    /// it gets the error when it reads a result.
    fn check(&self, gpu: &Gpu, operation: &'static str, buffer: &Handle) -> Result<(), GpuError> {
        if self.room.is_some() { Ok(()) } else { gpu.check(operation, &[buffer]) }
    }

    /// The number of launches for the longest possible list: no Gaussian is in a cell's list twice.
    pub(in crate::ops) fn chunks(&self, intersections: usize) -> usize {
        intersections.min(self.gaussians).div_ceil(self.chunk).max(1)
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

/// Gaussians on the screen, and the cells that each of them touches.
#[derive(Clone, Debug)]
pub(in crate::ops) struct Intersections {
    pub(in crate::ops) splats: Handle,
    /// `[1]`: number of all intersections.
    total: Handle,
    /// Intersections that the lists have room for: the number of all, or what the caller has chosen.
    pub(in crate::ops) count: usize,
    /// `[N]`: the first intersection of each Gaussian; the others follow it.
    pub(in crate::ops) first_of_gaussian: Handle,
    /// `[count]`: the Gaussian of each intersection.
    pub(in crate::ops) gaussians: Handle,
    /// `[count]`: intersections cell by cell, nearest first.
    pub(in crate::ops) order: Handle,
    /// `[cells + 1]`: where each cell begins in `order`.
    pub(in crate::ops) starts: Handle,
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuSplatSaved {
    frame: Frame,
    shapes: [Shape; 7],
    inputs: InputBuffers,
    intersections: Intersections,
    rendering: Arena,
}

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "splat", kernels, samples: &[] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    let flags = [false, true];
    let projecting = |cell| flags.map(|logarithms| projecting(cell, logarithms));
    let cells =
        Team::cells().into_iter().flat_map(|cell| projecting(cell).into_iter().chain([by_cells(INTERSECT, cell)]));
    let teams = Team::all().flat_map(|team| {
        let rasterizing = Kernel::new(RASTERIZE).blending(team);
        flags.map(|color_alone| rasterizing_backward(team, color_alone)).into_iter().chain([rasterizing])
    });
    cells.chain(teams).chain(flags.map(projecting_backward)).chain([CELL_COUNTS.into()]).collect()
}

/// A kernel of Gaussians that counts or lists cells.
fn by_cells(shader: Shader, cell: u32) -> Kernel {
    Kernel::new(shader).constant("CELL", cell)
}

fn projecting(cell: u32, logarithms: bool) -> Kernel {
    let kernel = by_cells(PROJECT, cell).constant("LOGARITHMS", logarithms.into());
    kernel.constant("DEPTH_BITS", DEPTH_BITS).constant("ALIGNMENT", PLACE_ALIGNMENT as u32)
}

fn projecting_backward(logarithms: bool) -> Kernel {
    let kernel = Kernel::new(PROJECT_BACKWARD).constant("LOGARITHMS", logarithms.into());
    kernel.constant("BOUND_REACHED", bound_reached().to_bits())
}

/// `color_alone`: alpha and depth have no gradient.
fn rasterizing_backward(team: Team, color_alone: bool) -> Kernel {
    Kernel::new(RASTERIZE_BACKWARD).blending(team).constant("COLOR_ALONE", color_alone.into())
}

fn project(gpu: &Gpu, frame: &Frame, inputs: &InputBuffers) -> Result<[Handle; 3], GpuError> {
    let count = frame.gaussians;
    // Splats, keys in the order of depths, radii.
    let layout = Places::new(&[16 * count, count, count]);
    let projected = gpu.allocate("splats", layout.total)?;
    Launch::new(&gpu.client, projecting(frame.team.cell, frame.logarithms))
        .reads(&inputs.means)
        .reads(&inputs.quats)
        .reads(&inputs.scales)
        .reads(&inputs.opacities)
        .reads(&inputs.screen_offsets)
        .reads(&inputs.sh_dc)
        .reads(&inputs.sh_rest)
        .writes(&projected)
        .uniform(&frame.uniform(0, 1))
        .invocations(count)?;
    Ok(std::array::from_fn(|k| layout.of(&projected, k)))
}

fn intersect(gpu: &Gpu, frame: &Frame, splats: Handle, depth_keys: &Handle) -> Result<Intersections, GpuError> {
    let gaussian_count = frame.gaussians;
    let by_depth = sort(gpu, depth_keys, gaussian_count, DEPTH_BITS)?.order;
    let first_places = gpu.allocate("places of intersections", gaussian_count)?;
    Launch::new(&gpu.client, CELL_COUNTS)
        .reads(&by_depth)
        .reads(&splats)
        .writes(&first_places)
        .uniform(&[gaussian_count as u32])
        .invocations(gaussian_count)?;
    let total = prefix_sum(gpu, &first_places, gaussian_count)?;
    let count = match frame.room {
        _ if gaussian_count == 0 => 0,
        // No Gaussian is in a cell's list twice. Room that the adapter cannot hold may not be needed: then they are counted.
        Some(room) if gpu.holds(room.saturating_mul(SUMS)) => room.min(gaussian_count.saturating_mul(frame.cells())),
        // The only read-back of an image: all further buffers have the size that it gives.
        _ => gpu.read_word("the number of intersections", &total)? as usize,
    };
    let frame = &Frame { room: Some(count), ..*frame };

    let first_of_gaussian = gpu.allocate("intersections of Gaussians", gaussian_count)?;
    let cells = gpu.allocate("cells of intersections", count)?;
    let gaussians = gpu.allocate("Gaussians of intersections", count)?;
    Launch::new(&gpu.client, by_cells(INTERSECT, frame.team.cell))
        .reads(&by_depth)
        .reads(&first_places)
        .updates(&splats)
        .writes(&first_of_gaussian)
        .writes(&cells)
        .writes(&gaussians)
        .reads(&total)
        .uniform(&frame.uniform(0, 1))
        .invocations(gaussian_count)?;
    let Sorted { keys, order } = sort(gpu, &cells, count, bits_for(frame.cells()))?;
    let starts = ranges(gpu, &keys, count, frame.cells())?;
    Ok(Intersections { splats, total, count, first_of_gaussian, gaussians, order, starts })
}

fn rasterize(gpu: &Gpu, frame: &Frame, lists: &Intersections) -> Result<Arena, GpuError> {
    let rendering = Arena::new(gpu, "image", &frame.values())?;
    let chunks = frame.chunks(lists.count);
    for chunk in 0..chunks {
        Launch::new(&gpu.client, Kernel::new(RASTERIZE).blending(frame.team))
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .updates_if(chunk > 0, &rendering.buffer)
            .uniform(&frame.uniform(chunk, chunks))
            .groups(frame.cells())?;
    }
    Ok(rendering)
}

/// An image's Gaussians on the screen, sorted into cells: the beginning of every pass over its pixels.
pub(in crate::ops) struct Begun {
    pub(in crate::ops) frame: Frame,
    shapes: [Shape; 7],
    inputs: InputBuffers,
    pub(in crate::ops) intersections: Intersections,
    /// `[N]` in pixels.
    radii: Handle,
}

/// Projects, intersects and sorts.
pub(in crate::ops) fn begin(gpu: &Gpu, inputs: SplatInputs<CubeBackend>, view: SplatView) -> Result<Begun, GpuError> {
    let inputs = inputs.into_array();
    let shapes = inputs.each_ref().map(|tensor| tensor.shape());
    let SplatView { view, room, logarithms, .. } = view;
    let frame = Frame {
        view,
        room,
        team: choose_team(gpu, view.camera.width, view.camera.height)?,
        gaussians: shapes[0][0],
        rest: shapes[5][1],
        logarithms,
        chunk: gpu.longest_list(),
    };
    let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] = inputs.map(buffer_of);
    let inputs = InputBuffers { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets };
    begin_with(gpu, frame, inputs, shapes)
}

fn begin_with(gpu: &Gpu, frame: Frame, inputs: InputBuffers, shapes: [Shape; 7]) -> Result<Begun, GpuError> {
    let [splats, depth_keys, radii] = project(gpu, &frame, &inputs)?;
    let intersections = intersect(gpu, &frame, splats, &depth_keys)?;
    Ok(Begun { frame, shapes, inputs, intersections, radii })
}

fn forward(gpu: &Gpu, begun: Begun) -> Result<(SplatOutputs<CubeBackend>, GpuSplatSaved), GpuError> {
    let Begun { frame, shapes, inputs, intersections, radii } = begun;
    let rendering = rasterize(gpu, &frame, &intersections)?;
    frame.check(gpu, "the image", &rendering.buffer)?;
    let [width, height] = frame.size().map(|side| side as usize);
    let outputs = SplatOutputs {
        image: gpu.tensor(rendering.tensor(0), Shape::from([height, width, 3])),
        alpha: gpu.tensor(rendering.tensor(1), Shape::from([height, width])),
        depth: gpu.tensor(rendering.tensor(2), Shape::from([height, width])),
        radii: gpu.int_tensor(first_words(&radii, frame.gaussians), Shape::from([frame.gaussians])),
        intersections: gpu.int_tensor(first_words(&intersections.total, 1), Shape::from([1])),
    };
    Ok((outputs, GpuSplatSaved { frame, shapes, inputs, intersections, rendering }))
}

/// The gradients of an image's pixels in one buffer, and whether only those of the color are there.
fn upstream_of(gpu: &Gpu, frame: &Frame, gradients: OfPixels<CubeBackend>) -> Result<(Handle, bool), GpuError> {
    let any = gradients.iter().flatten().next().expect("a gradient of image, alpha or depth");
    let (device, dtype) = (any.device(), any.dtype());
    match gradients {
        [Some(image), None, None] => Ok((buffer_of(image), true)),
        gradients => {
            let zeros = |count: usize| CubeBackend::float_zeros(Shape::from([count]), &device, dtype.into());
            let gradients = gradients.into_iter().zip(frame.values());
            let gradients: Vec<Handle> =
                gradients.map(|(gradient, count)| buffer_of(gradient.unwrap_or_else(|| zeros(count)))).collect();
            Ok((Arena::of(gpu, "gradients of pixels", &gradients, &frame.values())?.buffer, false))
        }
    }
}

fn backward(
    gpu: &Gpu,
    saved: GpuSplatSaved,
    gradients: OfPixels<CubeBackend>,
) -> Result<SplatInputs<CubeBackend>, GpuError> {
    let GpuSplatSaved { frame, shapes, inputs, intersections: lists, rendering } = saved;
    let (upstream, color_alone) = upstream_of(gpu, &frame, gradients)?;
    let sums = gpu.allocate("sums of intersections", SUMS * lists.count)?;
    let chunks = frame.chunks(lists.count);
    let carried = gpu.allocate("pixels between chunks", if chunks > 1 { 2 * frame.pixels() } else { 0 })?;
    for chunk in 0..chunks {
        Launch::new(&gpu.client, rasterizing_backward(frame.team, color_alone))
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .reads(&rendering.buffer)
            .reads(&upstream)
            .writes(&sums)
            .updates_if(chunk > 0, &carried)
            .uniform(&frame.uniform(chunk, chunks))
            .groups(frame.cells())?;
    }

    let layout = Places::new(&shapes.each_ref().map(|shape| shape.num_elements()));
    let gradients = gpu.allocate("gradients of Gaussians", layout.total)?;
    let mut uniform = frame.uniform(0, 1);
    uniform.extend(layout.starts.iter().map(|start| *start as u32));
    Launch::new(&gpu.client, projecting_backward(frame.logarithms))
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
    frame.check(gpu, "the gradients of an image", &gradients)?;
    let mut k = 0;
    Ok(SplatInputs::from_array(shapes.map(|shape| {
        k += 1;
        gpu.tensor(layout.of(&gradients, k - 1), shape)
    })))
}

impl SplatKernels for CubeBackend {
    type Saved = GpuSplatSaved;

    fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, GpuSplatSaved) {
        let drawn = Gpu::of(&inputs.means).and_then(|gpu| forward(&gpu, begin(&gpu, inputs, view)?));
        drawn.unwrap_or_else(|error| error.raise())
    }

    fn splat_backward(saved: GpuSplatSaved, gradients: OfPixels<Self>) -> SplatInputs<Self> {
        let any = gradients.iter().flatten().next().expect("a gradient of image, alpha or depth");
        let gpu = Gpu::of(any);
        gpu.and_then(|gpu| backward(&gpu, saved, gradients)).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + SplatKernels> SplatKernels for Fusion<B> {
    type Saved = B::Saved;

    fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, B::Saved) {
        let (outputs, saved) = B::splat_forward(resolve_inputs::<B>(inputs), view);
        let SplatOutputs { image, alpha, depth, radii, intersections } = outputs;
        let [image, alpha, depth] = [image, alpha, depth].map(leaf::<B>);
        let [radii, intersections] = [radii, intersections].map(int_leaf::<B>);
        (SplatOutputs { image, alpha, depth, radii, intersections }, saved)
    }

    fn splat_backward(saved: B::Saved, gradients: OfPixels<Self>) -> SplatInputs<Self> {
        let gradients = gradients.map(|gradient| gradient.map(resolve::<B>));
        let gradients = B::splat_backward(saved, gradients).into_array();
        SplatInputs::from_array(gradients.map(leaf::<B>))
    }
}

/// The tensors inside of a fusion stream.
pub(in crate::ops) fn resolve_inputs<B: FusionBackend>(inputs: SplatInputs<Fusion<B>>) -> SplatInputs<B> {
    SplatInputs::from_array(inputs.into_array().map(resolve::<B>))
}

#[cfg(test)]
mod tests {
    use burn_wgpu::CubeTensor;
    use glam::Vec3;
    use light4gs_data::Camera;

    use super::*;
    use crate::gpu::Communication::{SubgroupOfFew, SubgroupOfMany, WorkgroupMemory};
    use crate::gpu::default_gpu;

    const COUNT: usize = 300;
    const SIZE: [u32; 2] = [50, 37];

    /// Image and gradients of a scene, blended by a team in chunks of this length, and the number of its intersections.
    fn run(gpu: &Gpu, team: Team, room: Option<usize>, chunk: usize) -> (Vec<Vec<f32>>, usize) {
        // Any numbers that look random will do.
        let mut state = 1u32;
        let mut uniform = move |low: f32, high: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * (state >> 8) as f32 / (1 << 24) as f32
        };
        let widths = [3, 4, 3, 1, 3, 45, 2];
        let ranges = [(-1.0, 1.0), (-1.0, 1.0), (0.03, 0.3), (0.05, 1.0), (-0.5, 1.5), (-0.2, 0.2), (-0.01, 0.01)];
        let mut upload = |count: usize, (low, high): (f32, f32)| {
            let bytes: Vec<u8> = (0..count).flat_map(|_| uniform(low, high).to_le_bytes()).collect();
            gpu.client.create_from_slice(&bytes)
        };
        let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] =
            std::array::from_fn(|k| upload(widths[k] * COUNT, ranges[k]));
        let pixels = (SIZE[0] * SIZE[1]) as usize;
        let upstream = [3, 1, 1].map(|channels| upload(channels * pixels, (-1.0, 1.0)));
        let inputs = InputBuffers { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets };
        let camera = Camera::look_at(Vec3::new(0.0, -4.0, 0.5), Vec3::ZERO, Vec3::Z, 0.7, SIZE[0], SIZE[1]);
        let view = View { camera, background: [0.1, 0.5, 0.9], sh_degree: 3 };
        let shapes = widths.map(|width| Shape::from([COUNT, width]));
        let frame = Frame { view, team, gaussians: COUNT, rest: 15, room, logarithms: false, chunk };
        let (outputs, saved) = forward(gpu, begin_with(gpu, frame, inputs, shapes).unwrap()).unwrap();
        let count = gpu.read_word("intersections", &outputs.intersections.handle).unwrap();
        let upstream = upstream.map(|handle| {
            let values = handle.size() as usize / 4;
            Some(gpu.tensor(handle, Shape::from([values])))
        });
        let gradients = backward(gpu, saved, upstream).unwrap().into_array();
        let read = |tensor: CubeTensor| {
            let bytes = gpu.client.read_one(tensor.handle).unwrap();
            bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
        };
        let values = [outputs.image, outputs.alpha, outputs.depth].into_iter().chain(gradients).map(read).collect();
        (values, count as usize)
    }

    #[test]
    fn every_team_draws_the_same() {
        let gpu = default_gpu();
        let chosen = choose_team(&gpu, SIZE[0], SIZE[1]).unwrap();
        let (expected, _) = run(&gpu, chosen, None, COUNT);
        assert!(expected[2].iter().any(|depth| *depth > 1.0), "the scene is empty");
        let mut teams = vec![(32, WorkgroupMemory, 16), (32, WorkgroupMemory, 8), (8, WorkgroupMemory, 8)];
        if chosen.communication != WorkgroupMemory {
            let cells: &[u32] = if chosen.members <= 16 { &[8, 16] } else { &[16] };
            for cell in cells {
                teams.extend([(chosen.members, SubgroupOfFew, *cell), (chosen.members, SubgroupOfMany, *cell)]);
            }
        }
        for (members, communication, cell) in teams {
            // Each invocation has its pixels in groups of four.
            if cell * cell / members < 4 || members < cell {
                continue;
            }
            let team = Team { members, communication, cell };
            assert_alike(&run(&gpu, team, None, COUNT).0, &expected, &format!("{members} members, cell {cell}"));
        }
    }

    fn assert_alike(found: &[Vec<f32>], expected: &[Vec<f32>], what: &str) {
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            let largest = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            let pairs = found.iter().zip(expected);
            let error = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest;
            assert!(error < 1e-5, "{what}: output {k} is off by {error}");
        }
    }

    /// A list that is longer than a chunk is blended in several launches.
    #[test]
    fn long_lists_are_blended_in_chunks() {
        let gpu = default_gpu();
        let team = choose_team(&gpu, SIZE[0], SIZE[1]).unwrap();
        let (expected, _) = run(&gpu, team, None, COUNT);
        for chunk in [7, 64] {
            assert_alike(&run(&gpu, team, None, chunk).0, &expected, &format!("chunks of {chunk}"));
        }
    }

    /// The same to the bit, whatever the room, and a number that says where there is too little.
    #[test]
    fn room_for_the_lists_changes_nothing_but_the_waiting() {
        let gpu = default_gpu();
        let team = choose_team(&gpu, SIZE[0], SIZE[1]).unwrap();
        let (expected, count) = run(&gpu, team, None, COUNT);
        for room in [count, count + 1, 2 * count, 100 * count] {
            assert_eq!(run(&gpu, team, Some(room), COUNT), (expected.clone(), count), "room for {room} of {count}");
        }
        for room in [0, 1, count - 1] {
            assert_eq!(run(&gpu, team, Some(room), COUNT).1, count, "room for {room} of {count}");
        }
    }
}
