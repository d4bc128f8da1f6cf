//! Means over time on a GPU.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::{TIME_MEANS, TIME_MEANS_BACKWARD};

use super::{PlanesOverTime, TimeMeansKernels, TimeSizes, time_means};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "time_means", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [TIME_MEANS, TIME_MEANS_BACKWARD].map(Kernel::new).into()
}

impl TimeSizes {
    fn uniform(&self) -> [u32; 8] {
        let [a, b] = self.lengths.map(|length| length as u32);
        let [a_times, b_times] = self.times.map(|times| times as u32);
        let [a_share, b_share] = [0, 1].map(|plane| self.share(plane).to_bits());
        [self.channels as u32, a, b, 0, a_times, b_times, a_share, b_share]
    }
}

fn forward(planes: PlanesOverTime<CubeBackend>) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&planes.over_a)?;
    let sizes = TimeSizes::of(&planes);
    let [over_a, over_b] = [planes.over_a, planes.over_b].map(buffer_of);
    let count = sizes.output().iter().product();
    let means = gpu.allocate("means over time", count)?;
    let launch = Launch::new(&gpu.client, TIME_MEANS).reads(&over_a).reads(&over_b).writes(&means);
    launch.uniform(&sizes.uniform()).invocations(count)?;
    Ok(gpu.tensor(first_words(&means, count), Shape::from(sizes.output())))
}

fn backward(sizes: TimeSizes, gradient: CubeTensor) -> Result<PlanesOverTime<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&gradient)?;
    let counts = [0, 1].map(|plane| sizes.input(plane).iter().product());
    let of_a = gpu.allocate("gradients of the first plane", counts[0])?;
    let of_b = gpu.allocate("gradients of the second plane", counts[1])?;
    Launch::new(&gpu.client, TIME_MEANS_BACKWARD)
        .reads(&buffer_of(gradient))
        .writes(&of_a)
        .writes(&of_b)
        .uniform(&sizes.uniform())
        .invocations(sizes.channels * (sizes.lengths[0] + sizes.lengths[1]))?;
    Ok(PlanesOverTime {
        over_a: gpu.tensor(first_words(&of_a, counts[0]), Shape::from(sizes.input(0))),
        over_b: gpu.tensor(first_words(&of_b, counts[1]), Shape::from(sizes.input(1))),
    })
}

impl TimeMeansKernels for CubeBackend {
    fn time_means_forward(planes: PlanesOverTime<Self>) -> FloatTensor<Self> {
        forward(planes).unwrap_or_else(|error| error.raise())
    }

    fn time_means_backward(sizes: TimeSizes, gradient: FloatTensor<Self>) -> PlanesOverTime<Self> {
        backward(sizes, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + TimeMeansKernels> TimeMeansKernels for Fusion<B> {
    fn time_means_forward(planes: PlanesOverTime<Self>) -> FloatTensor<Self> {
        let [over_a, over_b] = [planes.over_a, planes.over_b].map(resolve::<B>);
        leaf::<B>(B::time_means_forward(PlanesOverTime { over_a, over_b }))
    }

    fn time_means_backward(sizes: TimeSizes, gradient: FloatTensor<Self>) -> PlanesOverTime<Self> {
        let PlanesOverTime { over_a, over_b } = B::time_means_backward(sizes, resolve::<B>(gradient));
        PlanesOverTime { over_a: leaf::<B>(over_a), over_b: leaf::<B>(over_b) }
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let (over_a, over_b) = (numbers.leaf(5, 3 * 40, -1.0, 1.0), numbers.leaf(5, 4 * 70, -1.0, 1.0));
    let means = time_means(over_a.clone().reshape([5, 3, 40]), over_b.clone().reshape([5, 4, 70]));
    numbers.with_gradients(means, &[over_a, over_b])
}
