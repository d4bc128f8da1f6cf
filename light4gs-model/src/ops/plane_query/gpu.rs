//! The query of feature planes on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::client::Client;
use cubecl::server::Handle;
use light4gs_codec::plane_layout::{AXIS_NAMES, PlaneAxes};
use light4gs_shaders::{PLANE_GATHER, PLANE_PACK, PLANE_QUERY, PLANE_QUERY_BACKWARD, Shader};

use super::{PLANES, PlaneQueryGradients, PlaneQueryInputs, PlaneQueryKernels, PlaneSet};
use crate::gpu::sort::{bits_for, ranges, sort};
use crate::gpu::{Arena, Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::GpuOperation;

/// Shapes of one query.
#[derive(Clone, Debug)]
struct Layout {
    points: usize,
    channels: usize,
    /// The planes that exist, with their shapes `[C, H, W]`.
    planes: Vec<(PlaneAxes, Shape)>,
}

impl Layout {
    /// Vectors of four channels.
    fn quads(&self) -> usize {
        self.channels.div_ceil(4)
    }

    fn cells_of(&self, plane: usize) -> usize {
        self.planes.get(plane).map_or(0, |(_, shape)| shape[1] * shape[2])
    }

    fn first_cell(&self, plane: usize) -> usize {
        (0..plane).map(|earlier| self.cells_of(earlier)).sum()
    }

    fn cells(&self) -> usize {
        self.first_cell(self.planes.len())
    }

    /// `Planes` of `shaders/include/planes.wgsl`.
    fn uniform(&self) -> Vec<u32> {
        let mut resolution = [1; AXIS_NAMES.len()];
        for (axes, shape) in &self.planes {
            let [across, down] = axes.axes();
            (resolution[across], resolution[down]) = (shape[2], shape[1]);
        }
        let first_cells = (0..=PLANES).map(|plane| self.first_cell(plane));
        let sizes = [self.points, self.channels, self.quads(), 0, 0];
        resolution.into_iter().chain(first_cells).chain(sizes).map(|value| value as u32).collect()
    }
}

/// A shader that includes `shaders/include/planes.wgsl`, for these planes.
fn kernel(shader: Shader, planes: impl IntoIterator<Item = PlaneAxes>) -> Kernel {
    let (mut count, mut pairs) = (0, 0);
    for axes in planes {
        pairs |= (axes as u32) << (3 * count);
        count += 1;
    }
    Kernel::new(shader).constant("PLANES", count).constant("AXIS_PAIRS", pairs)
}

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "plane_query", kernels, samples: &[] };

/// The kernels of this file, for every set of planes.
fn kernels() -> Vec<Kernel> {
    let sets = (1..1u32 << PLANES).flat_map(|set| {
        let planes = move || PlaneAxes::ALL.into_iter().filter(move |axes| set >> *axes as u32 & 1 == 1);
        [PLANE_QUERY, PLANE_QUERY_BACKWARD, PLANE_GATHER].map(|shader| kernel(shader, planes()))
    });
    sets.chain([PLANE_PACK.into()]).collect()
}

fn launch<'a>(client: &'a Client, shader: Shader, layout: &Layout) -> Launch<'a> {
    Launch::new(client, kernel(shader, layout.planes.iter().map(|(axes, _)| *axes)))
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuQuerySaved {
    layout: Layout,
    points: Handle,
    packed: Handle,
}

fn forward(inputs: PlaneQueryInputs<CubeBackend>, set: PlaneSet) -> Result<(CubeTensor, GpuQuerySaved), GpuError> {
    let gpu = Gpu::of(&inputs.points)?;
    let [points, planes @ ..] = inputs.into_array();
    let present = PlaneAxes::ALL.into_iter().zip(planes).zip(set.0).filter(|(_, present)| *present);
    let planes: Vec<(PlaneAxes, CubeTensor)> = present.map(|(plane, _)| plane).collect();
    let shapes: Vec<_> = planes.iter().map(|(axes, plane)| (*axes, plane.shape())).collect();
    let channels = shapes.first().map_or(0, |(_, shape)| shape[0]);
    let layout = Layout { points: points.shape()[0], channels, planes: shapes };
    let points = buffer_of(points);
    let packed = gpu.allocate("packed planes", 4 * layout.quads() * layout.cells())?;
    let lengths: Vec<usize> = layout.planes.iter().map(|(_, shape)| shape.num_elements()).collect();
    let planes: Vec<Handle> = planes.into_iter().map(|(_, plane)| buffer_of(plane)).collect();
    let planes = Arena::of(&gpu, "planes", &planes, &lengths)?;
    let mut rows = [[0; 4]; PLANES];
    for (k, start) in planes.places.starts.iter().enumerate() {
        rows[k] = [*start, layout.cells_of(k), layout.first_cell(k), 0].map(|number| number as u32);
    }
    let sizes = [layout.cells(), layout.channels, layout.quads(), 0].map(|size| size as u32);
    Launch::new(&gpu.client, PLANE_PACK)
        .reads(&planes.buffer)
        .writes(&packed)
        .uniform(&[&sizes, rows.as_flattened()].concat())
        .invocations(layout.cells())?;
    let features = gpu.allocate("features", layout.points * layout.channels)?;
    launch(&gpu.client, PLANE_QUERY, &layout)
        .reads(&points)
        .reads(&packed)
        .writes(&features)
        .uniform(&layout.uniform())
        .invocations(layout.points * layout.quads())?;
    let values = first_words(&features, layout.points * layout.channels);
    let output = gpu.tensor(values, Shape::from([layout.points, layout.channels]));
    Ok((output, GpuQuerySaved { layout, points, packed }))
}

fn backward(
    saved: GpuQuerySaved,
    upstream: CubeTensor,
    with_points: bool,
) -> Result<PlaneQueryGradients<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let upstream = buffer_of(upstream);
    let GpuQuerySaved { layout, points, packed } = saved;
    let samples = layout.planes.len() * layout.points;
    let handed = gpu.allocate("gradients of samples", 4 * layout.quads() * samples)?;
    let cells = gpu.allocate("cells of samples", samples)?;
    let fractions = gpu.allocate("fractions of samples", 2 * samples)?;
    let of_points = Places::new(&[4 * layout.points]);
    let point_gradients = gpu.allocate("gradients of points", of_points.total)?;
    launch(&gpu.client, PLANE_QUERY_BACKWARD, &layout)
        .reads(&points)
        .reads(&packed)
        .reads(&upstream)
        .writes(&handed)
        .writes(&cells)
        .writes(&fractions)
        .writes(&point_gradients)
        .uniform(&layout.uniform())
        .invocations(layout.points)?;

    let sorted = sort(&gpu, &cells, samples, bits_for(layout.cells()))?;
    let starts = ranges(&gpu, &sorted.keys, samples, layout.cells())?;
    let places = Places::new(&layout.planes.iter().map(|(_, shape)| shape.num_elements()).collect::<Vec<_>>());
    let mut firsts = places.starts.clone();
    firsts.resize(PLANES, places.total);
    let gradients = gpu.allocate("gradients of planes", places.total)?;
    // No cell has more samples than there are points.
    let at_most = gpu.longest_loop().min(layout.points.max(1));
    for begin in (0..layout.points.max(1)).step_by(at_most) {
        let mut uniform = layout.uniform();
        uniform.extend(firsts.iter().chain(&[begin, at_most]).map(|value| *value as u32));
        launch(&gpu.client, PLANE_GATHER, &layout)
            .reads(&starts)
            .reads(&sorted.order)
            .reads(&fractions)
            .reads(&handed)
            .updates_if(begin > 0, &gradients)
            .uniform(&uniform)
            .invocations(layout.cells() * layout.quads())?;
    }

    let points = with_points.then(|| gpu.tensor(of_points.of(&point_gradients, 0), Shape::from([layout.points, 4])));
    let mut planes = [const { None }; PLANES];
    for (k, (axes, shape)) in layout.planes.into_iter().enumerate() {
        planes[axes as usize] = Some(gpu.tensor(places.of(&gradients, k), shape));
    }
    Ok(PlaneQueryGradients { points, planes })
}

impl PlaneQueryKernels for CubeBackend {
    type Saved = GpuQuerySaved;

    fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (CubeTensor, GpuQuerySaved) {
        forward(inputs, planes).unwrap_or_else(|error| error.raise())
    }

    fn query_backward(saved: GpuQuerySaved, gradient: CubeTensor, with_points: bool) -> PlaneQueryGradients<Self> {
        backward(saved, gradient, with_points).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + PlaneQueryKernels> PlaneQueryKernels for Fusion<B> {
    type Saved = B::Saved;

    fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, B::Saved) {
        let inputs = PlaneQueryInputs::from_array(inputs.into_array().map(resolve::<B>));
        let (features, saved) = B::query_forward(inputs, planes);
        (leaf::<B>(features), saved)
    }

    fn query_backward(saved: B::Saved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self> {
        let PlaneQueryGradients { points, planes } = B::query_backward(saved, resolve::<B>(gradient), with_points);
        PlaneQueryGradients { points: points.map(leaf::<B>), planes: planes.map(|plane| plane.map(leaf::<B>)) }
    }
}
