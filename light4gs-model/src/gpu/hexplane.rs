//! The hexplane query on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::server::Handle;
use light4gs_shaders::{HEXPLANE_GATHER, HEXPLANE_PACK, HEXPLANE_QUERY, HEXPLANE_QUERY_BACKWARD};

use super::context::{Gpu, Places, buffer_of, first_words};
use super::kernel::Launch;
use super::sort::{bits_for, ranges, sort};
use crate::gpu_error::GpuError;
use crate::kernels::hexplane_query::{HexPlaneKernels, QueryGradients, QueryInputs};

const PLANES: usize = 6;

/// Shapes of one query.
#[derive(Clone, Debug)]
struct Layout {
    points: usize,
    channels: usize,
    /// `[C, H, W]` of each plane.
    planes: [Shape; PLANES],
}

impl Layout {
    /// Vectors of four channels.
    fn quads(&self) -> usize {
        self.channels.div_ceil(4)
    }

    fn cells_of(&self, plane: usize) -> usize {
        self.planes[plane][1] * self.planes[plane][2]
    }

    fn first_cell(&self, plane: usize) -> usize {
        (0..plane).map(|earlier| self.cells_of(earlier)).sum()
    }

    fn cells(&self) -> usize {
        self.first_cell(PLANES)
    }

    /// `Planes` of `shaders/include/hexplane.wgsl`.
    fn uniform(&self) -> Vec<u32> {
        let [xy, .., zt] = &self.planes;
        let resolution = [xy[2], xy[1], zt[2], zt[1]];
        let first_cells = (0..=PLANES).map(|plane| self.first_cell(plane));
        let sizes = [self.points, self.channels, self.quads(), 0, 0];
        resolution.into_iter().chain(first_cells).chain(sizes).map(|value| value as u32).collect()
    }
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuQuerySaved {
    layout: Layout,
    points: Handle,
    packed: Handle,
}

fn forward(inputs: QueryInputs<CubeBackend>) -> Result<(CubeTensor, GpuQuerySaved), GpuError> {
    let gpu = Gpu::of(&inputs.points)?;
    let [points, planes @ ..] = inputs.into_array();
    let shapes = planes.each_ref().map(|plane| plane.shape());
    let layout = Layout { points: points.shape()[0], channels: shapes[0][0], planes: shapes };
    let points = buffer_of(points);
    let packed = gpu.allocate("packed planes", 4 * layout.quads() * layout.cells())?;
    for (k, plane) in planes.into_iter().enumerate() {
        let sizes = [layout.cells_of(k), layout.channels, layout.quads(), layout.first_cell(k)];
        Launch::new(&gpu.client, HEXPLANE_PACK)
            .reads(&buffer_of(plane))
            .writes(&packed)
            .uniform(&sizes.map(|size| size as u32))
            .invocations(layout.cells_of(k))?;
    }
    let features = gpu.allocate("features", layout.points * layout.channels)?;
    Launch::new(&gpu.client, HEXPLANE_QUERY)
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
) -> Result<QueryGradients<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let upstream = buffer_of(upstream);
    let GpuQuerySaved { layout, points, packed } = saved;
    let samples = PLANES * layout.points;
    let handed = gpu.allocate("gradients of samples", 4 * layout.quads() * samples)?;
    let cells = gpu.allocate("cells of samples", samples)?;
    let fractions = gpu.allocate("fractions of samples", 2 * samples)?;
    let of_points = Places::new(&[4 * layout.points]);
    let point_gradients = gpu.allocate("gradients of points", of_points.total)?;
    Launch::new(&gpu.client, HEXPLANE_QUERY_BACKWARD)
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
    let places = Places::new(&layout.planes.each_ref().map(|shape| shape.num_elements()));
    let gradients = gpu.allocate("gradients of planes", places.total)?;
    // No cell has more samples than there are points, and each takes a round of a loop a vector.
    let at_most = (gpu.longest_loop() / layout.quads()).clamp(1, layout.points.max(1));
    for begin in (0..layout.points.max(1)).step_by(at_most) {
        let mut uniform = layout.uniform();
        uniform.extend(places.starts.iter().chain(&[begin, at_most]).map(|value| *value as u32));
        Launch::new(&gpu.client, HEXPLANE_GATHER)
            .reads(&starts)
            .reads(&sorted.order)
            .reads(&fractions)
            .reads(&handed)
            .updates_if(begin > 0, &gradients)
            .uniform(&uniform)
            .invocations(layout.cells())?;
    }
    gpu.check("the gradients of the planes", &[&gradients])?;

    let points = with_points.then(|| gpu.tensor(of_points.of(&point_gradients, 0), Shape::from([layout.points, 4])));
    let mut k = 0;
    let planes = layout.planes.map(|shape| {
        k += 1;
        gpu.tensor(places.of(&gradients, k - 1), shape)
    });
    Ok(QueryGradients { points, planes })
}

impl HexPlaneKernels for CubeBackend {
    type Saved = GpuQuerySaved;

    fn query_forward(inputs: QueryInputs<Self>) -> (CubeTensor, GpuQuerySaved) {
        forward(inputs).unwrap_or_else(|error| error.raise())
    }

    fn query_backward(saved: GpuQuerySaved, gradient: CubeTensor, with_points: bool) -> QueryGradients<Self> {
        backward(saved, gradient, with_points).unwrap_or_else(|error| error.raise())
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor};

    use crate::scene::hexplane::HexPlaneConfig;

    /// Far more points in one cell than a loop of Mesa's software driver takes.
    #[test]
    fn a_crowded_cell() {
        const POINTS: usize = 20_000;
        let config = HexPlaneConfig::new().with_channels(18).with_resolution([4, 4, 4, 4]).with_multipliers(vec![1]);
        let gradients = |device: Device| {
            let device = device.autodiff();
            let planes = config
                .init(&Device::flex())
                .planes
                .into_iter()
                .map(|plane| Tensor::from_data(plane.val().into_data(), &device).require_grad());
            let planes: Vec<Tensor<3>> = planes.collect();
            let points = Tensor::<2>::full([POINTS, 4], 0.1, &device);
            let features = crate::scene::hexplane::query_planes(points, planes.clone());
            let gradients = features.sum().backward();
            let all = planes.iter().map(|plane| plane.grad(&gradients).expect("planes have gradients"));
            let sums = all.map(|gradient| gradient.sum().into_scalar::<f32>());
            sums.collect::<Vec<_>>()
        };
        Device::flex().seed(1);
        let expected = gradients(Device::flex());
        Device::flex().seed(1);
        let found = gradients(Device::wgpu(Default::default()));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() <= 1e-3 * expected.abs(), "{found} against {expected}");
        }
    }
}
