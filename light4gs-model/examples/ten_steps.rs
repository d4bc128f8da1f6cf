//! Ten training steps on every back end of this build, with this crate and Burn alone: a scene learns to look like
//! another one, and every back end has to arrive at the same loss, with the same significance of its Gaussians. The
//! elementwise operations of the entropy models have to agree as well.
//!
//! `cargo run --release -p light4gs-model --example ten_steps`

// Burn 0.22 deprecates its `ndarray` back end in favor of `flex`; we serve both.
#![allow(deprecated)]

use std::collections::HashMap;
use std::error::Error;

use burn::module::Param;
use burn::tensor::{Device, Gradients, Tensor};
use light4gs_data::{Camera, PointCloud};
use light4gs_model::gaussian_conditional::{NormalParameters, gaussian_likelihood};
use light4gs_model::ops::adam::{AdamStep, SteppedParameter, adam_steps};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::parameters::{ParameterMapper, map_parameters, update_parameters};
use light4gs_model::{
    DeformationConfig, DynamicScene, DynamicSceneConfig, GaussiansConfig, HexPlaneConfig, HexPlaneField,
    HexPlaneFieldConfig, PixelContribution, Significance, Splatter,
};

const STEPS: u32 = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers: Vec<(&str, Vec<f32>)> = Vec::new();
    for (name, device) in devices() {
        let device = device.autodiff();
        let [first, last, significance] = train(&device);
        println!("{name:>8}: loss {first:.6} before, {last:.6} after {STEPS} steps");
        if last >= 0.9 * first {
            return Err(format!("{name} has learned nothing").into());
        }
        numbers.push((name, [vec![first, last, significance], elementwise(&device)].concat()));
    }
    let Some((reference, expected)) = numbers.first() else { return Err("this build has no back end".into()) };
    for (name, found) in &numbers {
        for (found, expected) in found.iter().zip(expected) {
            if (found - expected).abs() > 1e-3 * expected.abs() {
                return Err(format!("{name} has {found} where {reference} has {expected}").into());
            }
        }
    }
    Ok(())
}

/// Those that Burn was built with.
fn devices() -> Vec<(&'static str, Device)> {
    // A program that depends on this crate knows which features it has asked for.
    vec![
        #[cfg(feature = "ndarray")]
        ("ndarray", Device::ndarray()),
        #[cfg(feature = "flex")]
        ("flex", Device::flex()),
        #[cfg(feature = "wgpu")]
        ("wgpu", Device::wgpu(Default::default())),
    ]
}

/// The loss before the first step and after the last, and the sum of the Gaussians' blending weights in the end.
fn train(device: &Device) -> [f32; 3] {
    let positions: Vec<[f32; 3]> =
        (0..200).map(|i| i as f32).map(|i| [i.sin(), (1.7 * i).sin(), (2.3 * i).sin()]).collect();
    let cloud = |colors: Vec<[f32; 3]>| PointCloud { positions: positions.clone(), colors };
    let truth = cloud((0..200).map(|i| i as f32).map(|i| [0.5 + 0.5 * i.cos(), 0.5, 0.5 + 0.5 * i.sin()]).collect());
    let splatter = Splatter::new([1.0; 3], 0);
    let cameras = [[0.0, -5.0, 1.0], [5.0, 0.0, 1.0]]
        .map(|eye: [f32; 3]| Camera::look_at(eye.into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 64, 48));
    let images = cameras.map(|camera| {
        let gaussians = GaussiansConfig::new().init(&truth, &device.clone().inner()).tensors();
        splatter.render(gaussians, &camera, None).image
    });

    let loss = |scene: &DynamicScene<HexPlaneField>| {
        let terms = cameras.iter().zip(&images).enumerate().map(|(time, (camera, image))| {
            let rendering = splatter.render(scene.at(time as f32), camera, None);
            (rendering.image - Tensor::from_inner(image.clone())).abs().mean()
        });
        terms.reduce(|sum, term| sum + term).expect("two cameras")
    };

    let mut scene = scene(&cloud(vec![[0.5; 3]; 200]), device);
    let first: f32 = loss(&scene).into_scalar();
    let mut moments = HashMap::new();
    for time in 1..=STEPS {
        let gradients = loss(&scene).backward();
        update_parameters(&mut scene, &mut Adam { gradients, moments: &mut moments, time });
    }
    let mut significance = Significance::new(scene.gaussians.len());
    significance.add(&splatter, scene.at(0.0), &cameras[0]);
    let weights: f64 = significance.sums(PixelContribution::BlendingWeight).iter().sum();
    [first, loss(&scene).into_scalar(), weights as f32]
}

/// Values and gradients of the normal distribution and of the lower bound.
fn elementwise(device: &Device) -> Vec<f32> {
    let values = || Tensor::<1>::from_floats([-6.0, -1.5, -0.2, 0.0, 0.7, 3.0], device).require_grad();
    let weights = Tensor::<1>::from_floats([1.0, -1.0, 2.0, -2.0, 1.5, -0.5], device);
    let mut found = Vec::new();
    let likelihood = |x: Tensor<1>| {
        let parameters = NormalParameters::new(x.zeros_like(), x.ones_like());
        gaussian_likelihood(x, parameters)
    };
    for operation in [likelihood as fn(_) -> _, |x| lower_bound(x, 0.5)] {
        let x = values();
        let y = operation(x.clone());
        let gradient = x.grad(&(y.clone() * weights.clone()).sum().backward()).expect("it has one");
        found.extend(y.inner().into_data().iter::<f32>());
        found.extend(gradient.into_data().iter::<f32>());
    }
    found
}

/// One step on every parameter that has a gradient.
struct Adam<'a> {
    gradients: Gradients,
    moments: &'a mut HashMap<String, [Tensor<1>; 2]>,
    time: u32,
}

impl ParameterMapper for Adam<'_> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(gradient) = parameter.val().grad_remove(&mut self.gradients) else { return parameter };
        let gradient = gradient.flatten::<1>(0, D - 1);
        let zeros = || [gradient.zeros_like(), gradient.zeros_like()];
        let moments = self.moments.remove(path).unwrap_or_else(zeros);
        let step = AdamStep { learning_rate: 0.01, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: self.time };
        let (id, shape) = (parameter.id, parameter.dims());
        let value = parameter.into_value().inner().flatten(0, D - 1);
        let (value, moments) = adam_steps(vec![SteppedParameter { value, moments, gradient, step }]).remove(0);
        self.moments.insert(path.to_owned(), moments);
        Param::initialized(id, Tensor::from_inner(value.reshape(shape)).require_grad())
    }
}

/// The field's numbers are the same on every back end, whose random numbers are not.
fn scene(cloud: &PointCloud, device: &Device) -> DynamicScene<HexPlaneField> {
    let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..Default::default() };
    // One head is enough here.
    let deformation = DeformationConfig { width: 16, scale: false, rotation: false, ..Default::default() };
    let field = HexPlaneFieldConfig { hexplane, deformation };
    let scene = DynamicSceneConfig::new(GaussiansConfig::new(), field).init(cloud, device);
    DynamicScene { field: map_parameters(scene.field, &mut Waves), ..scene }
}

struct Waves;

impl ParameterMapper for Waves {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (shape, device) = (parameter.dims(), parameter.device());
        let (middle, height) = if path.contains("planes") { (0.7, 0.3) } else { (0.0, 0.1) };
        let count = shape.iter().product::<usize>();
        let values: Vec<f32> = (0..count).map(|i| middle + height * (1.3 * i as f32).sin()).collect();
        let values = Tensor::<1>::from_floats(values.as_slice(), &device).reshape(shape);
        Param::initialized(parameter.id, values.require_grad())
    }
}
