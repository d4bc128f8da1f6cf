//! The fused Adam step on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::ADAM;

use super::{AdamOps, AdamStep, AdamTensors, SteppedParameter, adam_steps};
use crate::gpu::{Arena, Gpu, Kernel, Launch, batches, buffer_of};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaves, resolve_all};
use crate::ops::sample::{GpuOperation, Numbers};
use crate::ops::tensor_list::TensorList;

/// Most tensors of a launch.
const MOST_TENSORS: usize = 64;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "adam", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![kernel()]
}

fn kernel() -> Kernel {
    Kernel::new(ADAM).constant("MOST_TENSORS", MOST_TENSORS as u32)
}

/// A parameter, its first and second moment.
type Stepped = [CubeTensor; 3];

/// A parameter, its moments, its gradient, and the numbers of its step.
type Stepping = (Stepped, CubeTensor, AdamStep);

fn steps_of(
    tensors: AdamTensors<CubeBackend>,
    gradients: Vec<CubeTensor>,
    steps: Vec<AdamStep>,
) -> Result<Vec<Stepped>, GpuError> {
    let AdamTensors { parameters, first_moments, second_moments } = tensors;
    let Some(any) = parameters.0.first() else { return Ok(Vec::new()) };
    let gpu = Gpu::of(any)?;
    let lengths: Vec<usize> = gradients.iter().map(|gradient| gradient.shape().num_elements()).collect();
    let moments = first_moments.0.into_iter().zip(second_moments.0);
    let stepped = parameters.0.into_iter().zip(moments).map(|(parameter, (first, second))| [parameter, first, second]);
    let mut rest = stepped.zip(gradients).zip(steps).map(|((stepped, gradient), step)| (stepped, gradient, step));
    let mut done = Vec::with_capacity(lengths.len());
    for batch in batches(&gpu, &lengths, MOST_TENSORS) {
        done.extend(step_at_once(&gpu, rest.by_ref().take(batch.len()).collect())?);
    }
    Ok(done)
}

fn step_at_once(gpu: &Gpu, batch: Vec<Stepping>) -> Result<Vec<Stepped>, GpuError> {
    let lengths: Vec<usize> = batch.iter().map(|(_, gradient, _)| gradient.shape().num_elements()).collect();
    let shapes: Vec<_> = batch.iter().map(|(_, gradient, _)| gradient.shape()).collect();
    let steps: Vec<AdamStep> = batch.iter().map(|(_, _, step)| *step).collect();
    let mut old: [Vec<Handle>; 4] = Default::default();
    for ([parameter, first, second], gradient, _) in batch {
        for (list, tensor) in old.iter_mut().zip([parameter, gradient, first, second]) {
            list.push(buffer_of(tensor));
        }
    }
    let new = [(); 3].map(|()| Arena::new(gpu, "parameters and moments after a step", &lengths));
    let [parameters, firsts, seconds] = new;
    let new = [parameters?, firsts?, seconds?];
    let total = new[0].places.total;

    let mut uniform = vec![steps.len() as u32, total as u32, 0, 0];
    let row = |numbers: &mut dyn Iterator<Item = [u32; 4]>| {
        let mut words: Vec<u32> = numbers.flatten().collect();
        words.resize(4 * MOST_TENSORS, 0);
        words
    };
    uniform.extend(row(&mut steps.iter().enumerate().map(|(k, step)| {
        let [start, length] = [new[0].places.starts[k], lengths[k]].map(|number| number as u32);
        [start, length, step.corrected_learning_rate().to_bits(), step.root_correction().to_bits()]
    })));
    uniform.extend(row(&mut steps.iter().map(|AdamStep { beta_1, beta_2, .. }| {
        [*beta_1, 1.0 - beta_1, *beta_2, 1.0 - beta_2].map(|decay| (decay as f32).to_bits())
    })));
    uniform.extend(row(&mut steps.iter().map(|step| [step.epsilon.to_bits(), 0, 0, 0])));

    let mut launch = Launch::new(&gpu.client, kernel());
    for (name, tensors) in ["parameters", "gradients", "first moments", "second moments"].into_iter().zip(&old) {
        launch = launch.reads(&Arena::of(gpu, name, tensors, &lengths)?.buffer);
    }
    let launch = new.iter().fold(launch, |launch, arena| launch.writes(&arena.buffer));
    launch.uniform(&uniform).invocations(total)?;
    Ok((0..steps.len()).map(|k| new.each_ref().map(|arena| gpu.tensor(arena.tensor(k), shapes[k].clone()))).collect())
}

impl AdamOps for CubeBackend {
    fn adam(tensors: AdamTensors<Self>, gradients: TensorList<Self>, steps: Vec<AdamStep>) -> AdamTensors<Self> {
        let stepped = steps_of(tensors, gradients.0, steps).unwrap_or_else(|error| error.raise());
        let mut lists: [Vec<CubeTensor>; 3] = Default::default();
        for tensors in stepped {
            for (list, tensor) in lists.iter_mut().zip(tensors) {
                list.push(tensor);
            }
        }
        let [parameters, first_moments, second_moments] = lists.map(TensorList);
        AdamTensors { parameters, first_moments, second_moments }
    }
}

impl<B: FusionBackend + AdamOps> AdamOps for Fusion<B> {
    fn adam(tensors: AdamTensors<Self>, gradients: TensorList<Self>, steps: Vec<AdamStep>) -> AdamTensors<Self> {
        let tensors = AdamTensors {
            parameters: resolve_all(tensors.parameters),
            first_moments: resolve_all(tensors.first_moments),
            second_moments: resolve_all(tensors.second_moments),
        };
        let stepped = B::adam(tensors, resolve_all(gradients), steps);
        AdamTensors {
            parameters: leaves(stepped.parameters),
            first_moments: leaves(stepped.first_moments),
            second_moments: leaves(stepped.second_moments),
        }
    }
}

/// Two steps of more tensors than a launch takes, the second from where the first has left them.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(device);
    let mut row = |count: usize, low: f32, high: f32| numbers.matrix(1, count, low, high).flatten::<1>(0, 1);
    let mut parameters: Vec<SteppedParameter> = (0..MOST_TENSORS + 2)
        .map(|k| {
            let count = if k == 1 { 2600 } else { 1 + 7 * k };
            let step = AdamStep {
                learning_rate: 0.1 / (1 + k) as f32,
                beta_1: 0.9,
                beta_2: 0.999,
                epsilon: 1e-15,
                time: 3 + k as u32,
            };
            SteppedParameter {
                value: row(count, -1.0, 1.0),
                moments: [row(count, -0.1, 0.1), row(count, 0.0, 0.1)],
                gradient: row(count, -13.0, 13.0),
                step,
            }
        })
        .collect();
    let first = adam_steps(parameters.clone());
    for (parameter, (value, moments)) in parameters.iter_mut().zip(first) {
        (parameter.value, parameter.moments) = (value, moments);
        parameter.step.time += 1;
    }
    let stepped = adam_steps(parameters).into_iter();
    stepped.flat_map(|(value, [first, second])| [value, first, second]).map(|tensor| tensor.into_data()).collect()
}
