//! The rate of the attributes: its estimate against the bytes of the codec, its derivatives against differences, and
//! the noise.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::attributes::{self, AttributeSteps};
use light4gs_codec::{FurtherAttribute, GaussianArrays};
use light4gs_data::PointCloud;
use light4gs_model::{Attribute, AttributeEntropy, CodedAttribute, GaussianTensors, Gaussians, GaussiansConfig};
use light4gs_tests::golden::{devices, values_of};
use light4gs_tests::random::Random;

const COUNT: usize = 4000;

/// Gaussians whose numbers are independent, so that a coder has nothing to predict from.
fn gaussians(device: &Device) -> Gaussians {
    let mut random = Random::new(7);
    let positions = (0..COUNT).map(|_| std::array::from_fn(|_| random.uniform(-1.0, 1.0) as f32)).collect();
    let cloud = PointCloud { positions, colors: vec![[0.5; 3]; COUNT] };
    let config = GaussiansConfig::new().with_sh_degree(1).with_attribute(Attribute::new("age", 2).with_step(0.1));
    let mut gaussians = config.init(&cloud, device);
    let mut normals = |width: usize, mean: f64, spread: f64| {
        let values = random.normals(COUNT * width).into_iter().map(|v| (mean + spread * v) as f32).collect();
        Tensor::<2>::from_data(TensorData::new::<f32, _>(values, [COUNT, width]), device)
    };
    let mut tensors = gaussians.tensors();
    tensors.log_scales = normals(3, -3.0, 0.5);
    tensors.quats = normals(4, 0.3, 0.4);
    tensors.opacity_logits = normals(1, 1.0, 2.0);
    tensors.sh_dc = normals(3, 0.0, 1.0).reshape([COUNT, 1, 3]);
    tensors.further[0].values = normals(2, 5.0, 3.0);
    gaussians.set_tensors(tensors);
    gaussians
}

/// A model of all attributes but the higher harmonics, with the codec's steps.
fn model(device: &Device, tensors: &GaussianTensors) -> AttributeEntropy {
    let coded = |name: &str, width, step| CodedAttribute { name: name.to_owned(), width, step };
    let steps = AttributeSteps::default();
    let built_in = [("means", 3), ("log_scales", 3), ("quats", 4), ("opacity_logits", 1), ("sh_dc", 3)];
    let built_in = built_in.map(|(name, width)| coded(name, width, steps.of(name).unwrap()));
    let mut model = AttributeEntropy::new(built_in.into_iter().chain([coded("age", 2, 0.1)]).collect(), device);
    model.start_from(tensors);
    model
}

#[test]
fn the_estimate_is_near_the_bytes_of_the_codec() {
    for (name, device) in devices() {
        let gaussians = gaussians(&device);
        let model = model(&device, &gaussians.tensors());
        let bits: f64 = model.bits_of_each(gaussians.tensors()).sum().into_scalar();

        let rows = |values: Vec<f32>| values.as_chunks().0.to_vec();
        let arrays = GaussianArrays {
            means: rows(values_of(&gaussians.means.val())),
            log_scales: rows(values_of(&gaussians.log_scales.val())),
            quats: values_of(&gaussians.quats.val()).as_chunks().0.to_vec(),
            opacity_logits: values_of(&gaussians.opacity_logits.val()),
            sh_dc: rows(values_of(&gaussians.sh_dc.val())),
            further: vec![FurtherAttribute {
                name: "age".into(),
                width: 2,
                values: values_of(gaussians.tensors().further("age").unwrap()),
                optional: false,
            }],
            ..GaussianArrays::default()
        };
        let steps = model.steps(AttributeSteps::default().with("age", 1.0), &arrays.log_scales);
        assert!((steps.of("age").unwrap() - 0.1).abs() < 1e-6, "{name}: {steps:?}");
        assert!((steps.of("means").unwrap() - 0.05).abs() < 1e-4, "{name}: {steps:?}");
        let encoded = attributes::encode(&arrays, &steps).unwrap();
        let coded = 8.0 * encoded.bytes.len() as f64;
        // The densities have not been trained yet, and a mixture of three logistics is not a normal distribution.
        assert!((bits / coded - 1.0).abs() < 0.03, "{name}: {bits} expected, {coded} coded");
        let each = values_of(&model.bits_of_each(gaussians.tensors()));
        assert!((each.iter().map(|bits| f64::from(*bits)).sum::<f64>() / bits - 1.0).abs() < 1e-5, "{name}: {each:?}");
        for ((attribute, bits), written) in model.attributes().iter().zip(each).zip(encoded.attributes) {
            let (bits, coded, coded_name) = (f64::from(bits), 8.0 * written.bytes as f64, written.name);
            assert_eq!(attribute.name, coded_name);
            // Positions are counted by the coder itself: nothing but the grid, 17 bytes, is missing.
            let near = if coded_name == "means" {
                (coded - bits).abs() <= 8.0 * 18.0
            } else {
                (bits / coded - 1.0).abs() < 0.04
            };
            assert!(near, "{name}, {coded_name}: {bits} expected, {coded} coded");
        }
    }
}

/// Information that neighbors and earlier channels give is neither in the estimate nor in the file.
#[test]
fn the_estimate_knows_neighbors_and_channels_before() {
    let device = Device::flex();
    let mut gaussians = gaussians(&device);
    let independent: f64 = model(&device, &gaussians.tensors()).bits_of_each(gaussians.tensors()).sum().into_scalar();
    let mut tensors = gaussians.tensors();
    let [x, y, z] = [0, 1, 2].map(|axis| tensors.means.clone().narrow(1, axis, 1));
    // Scales change slowly from place to place; the second and third color follow from the first.
    tensors.log_scales = Tensor::cat(vec![(x * 2.0).sin(), (y * 2.0).cos(), (z * 2.0).sin()], 1) - 3.0;
    let first = tensors.sh_dc.clone().narrow(2, 0, 1);
    tensors.sh_dc = Tensor::cat(vec![first.clone(), first.clone() * 0.5, first * -0.8 + 0.3], 2);
    gaussians.set_tensors(tensors);
    let model = model(&device, &gaussians.tensors());
    let bits: f64 = model.bits_of_each(gaussians.tensors()).sum().into_scalar();
    // Two of three colors are known but for rounding, and half of the bits of the scales.
    let colors = 2.0 * 5.0 * COUNT as f64;
    assert!(bits < independent - colors, "{bits} of {independent}");
    let mut untold = model.clone();
    untold.prediction.weights = Param::from_tensor(model.prediction.weights.val().zeros_like());
    let blind: f64 = untold.bits_of_each(gaussians.tensors()).sum().into_scalar();
    assert!(bits < 0.9 * blind, "{bits}, without predictions {blind}");
}

#[test]
fn a_correction_multiplies_the_bits_of_its_attribute() {
    let device = Device::flex();
    let gaussians = gaussians(&device);
    let mut model = model(&device, &gaussians.tensors());
    let before = values_of(&model.bits_of_each(gaussians.tensors()));
    // Means, scales, rotations, opacity, color, age: positions have no density that could be wrong.
    let factors = [3.0, 1.0, 1.5, 0.5, 1.0, 1.25];
    model.correct(&factors);
    model.correct(&[1.0, 1.0, 2.0, 1.0, 1.0, 1.0]);
    let expected: Vec<f32> =
        before.iter().zip([1.0, 1.0, 3.0, 0.5, 1.0, 1.25]).map(|(bits, factor)| bits * factor).collect();
    let after = values_of(&model.bits_of_each(gaussians.tensors()));
    for (found, expected) in after.iter().zip(&expected) {
        assert!((found / expected - 1.0).abs() < 1e-5, "{after:?}, expected {expected:?}");
    }
}

#[test]
fn rows_stand_for_all() {
    let device = Device::flex();
    let gaussians = gaussians(&device);
    let model = model(&device, &gaussians.tensors());
    let all: f64 = model.bits_of_each(gaussians.tensors()).sum().into_scalar();
    let rows: Vec<u32> = (0..COUNT as u32).step_by(4).collect();
    let some: f64 =
        model.bits(gaussians.tensors(), &model.places(gaussians.means.val()), &rows, 1.0).sum().into_scalar();
    assert!((some / all - 1.0).abs() < 0.02, "{some} from a quarter, {all} from all");
}

/// Coarser steps take fewer bits, as the derivative says. Bits of positions are those of the coder, which are smooth only from one
/// grid to one that is twice as fine.
#[test]
fn derivatives_of_the_steps_are_those_of_differences() {
    let device = Device::flex().autodiff();
    let gaussians = gaussians(&device);
    let model = model(&device, &gaussians.tensors());
    let tape = model.bits_of_each(gaussians.tensors()).sum().backward();
    let gradient = values_of(&model.log_steps.val().grad(&tape).unwrap());
    let steps = values_of(&model.log_steps.val());
    for (place, attribute) in model.attributes().iter().enumerate() {
        let bits = |change: f32| -> f64 {
            let mut moved = steps.clone();
            moved[place] += change;
            let mut model = model.clone();
            model.log_steps = Param::from_tensor(Tensor::from_floats(moved.as_slice(), &device));
            model.bits_of_each(gaussians.tensors()).sum().into_scalar()
        };
        let change = if attribute.name == "means" { std::f32::consts::LN_2 } else { 0.05 };
        let difference = (bits(change) - bits(-change)) / f64::from(2.0 * change);
        let found = f64::from(gradient[place]);
        assert!(found < 0.0, "{}: {found}", attribute.name);
        assert!((found / difference - 1.0).abs() < 0.02, "{}: {found}, differences {difference}", attribute.name);
    }
}

#[test]
fn noise_is_as_wide_as_the_steps() {
    let device = Device::flex().autodiff();
    let gaussians = gaussians(&device);
    let model = model(&device, &gaussians.tensors());
    let noisy = model.add_noise(gaussians.tensors(), 3);
    let check = |name: &str, exact: Vec<f32>, noisy: Vec<f32>| {
        // Positions are in units of the Gaussians' size.
        let unit = if name == "means" { values_of(&model.size.val())[0] } else { 1.0 };
        let step = unit * model.step(name).unwrap();
        let errors: Vec<f32> = exact.iter().zip(&noisy).map(|(a, b)| (a - b) / step).collect();
        assert!(errors.iter().all(|error| error.abs() <= 0.501), "{name}");
        let variance = errors.iter().map(|error| error * error).sum::<f32>() / errors.len() as f32;
        assert!((variance * 12.0 - 1.0).abs() < 0.1, "{name}: {variance}");
    };
    check("means", values_of(&gaussians.means.val()), values_of(&noisy.means));
    check("quats", values_of(&gaussians.quats.val()), values_of(&noisy.quats));
    check("sh_dc", values_of(&gaussians.sh_dc.val()), values_of(&noisy.sh_dc));
    let age = |tensors: &GaussianTensors| values_of(tensors.further("age").unwrap());
    check("age", age(&gaussians.tensors()), age(&noisy));
    assert_eq!(model.step("sh_rest"), None);
    assert_eq!(values_of(&gaussians.sh_rest.val()), values_of(&noisy.sh_rest));
}
