//! Golden case c06 (the hexplane context model of the public code) on every back end.
//!
//! The reference differs from ours in one part: its inter-plane context averages the space-time planes over space
//! instead of time, adds the two maps, and shares its convolution with the inter-scale context. That part is written
//! here as one more [`PriorPart`]. Everything else is the model itself in its reference configuration.

use burn::tensor::{Device, Tensor, s};
use light4gs_codec::network::Operation;
use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs_codec::{Network, PlaneSource};
use light4gs_model::gaussian_conditional::{bits, gaussian_likelihood};
use light4gs_model::{
    CenteredPlanes, ContextModel, ContextModelConfig, ContextPart, DescribedCondition, DescribedPrior, InterPlane,
    InterScale, KernelShape, Latent, Passes, PlaneEntropy, PlaneSteps, PlaneTensors, Prior, PriorPart, anchor_mask,
    checkerboard_kernel, upsample,
};
use light4gs_tests::golden::{Golden, assert_close, assert_close_relative, devices, values_of};
use light4gs_tests::named::{compare_density, compare_gradients, load, load_density};

/// The golden file's name of one of our parameters, `None` for the density, which is several arrays there.
fn name_in_file(path: &str) -> Option<String> {
    if path.starts_with("hyperprior.bottleneck.density") {
        return None;
    }
    let names = [
        ("hyperprior.analysis.0", "h_a.0"),
        ("hyperprior.analysis.1", "h_a.2"),
        ("hyperprior.analysis.2", "h_a.4"),
        ("hyperprior.bottleneck", "entropy_bottleneck"),
        ("hyperprior.synthesis_up.0", "h_s.0"),
        ("hyperprior.synthesis_up.1", "h_s.2"),
        ("hyperprior.synthesis_out", "h_s.4"),
        ("checkerboard.conv", "context_prediction"),
        ("inter_scale.conv", "context_to_params"),
        ("entropy_parameters.layers.0", "entropy_parameters.0"),
        ("entropy_parameters.layers.1", "entropy_parameters.2"),
        ("entropy_parameters.layers.2", "entropy_parameters.4"),
    ];
    let (ours, theirs) = names.iter().find(|(ours, _)| path.starts_with(ours)).expect("the file has every parameter");
    Some(path.replace(ours, theirs))
}

/// The reference's model with the file's sizes and weights. The file's only bottleneck is the hyperprior's.
fn model_of(golden: &Golden, device: &Device) -> ContextModel {
    let [channels, ..] = plane_shape(golden);
    let latent_channels = golden.shape("param.h_a.0.weight")[0];
    let mut config = ContextModelConfig::reference(channels);
    config.latent_channels = latent_channels;
    config.inter_scale = KernelShape::new(golden.shape("param.context_to_params.weight")[2], 1);
    // The reference's inter-plane part is defined in this test.
    config.parts.retain(|part| *part != ContextPart::InterPlane);
    let mut model = config.init(device);
    load(&mut model, golden, |path| Some(format!("param.{}", name_in_file(path)?)));
    let hyperprior = model.hyperprior.as_mut().expect("the reference's model has a hyperprior");
    load_density(&mut hyperprior.bottleneck.density, golden, "param.entropy_bottleneck.");
    model
}

fn plane_shape(golden: &Golden) -> [usize; 3] {
    golden.shape("plane.scale0.0")[1..].try_into().expect("planes are [1, M, H, W]")
}

fn scales_of(golden: &Golden) -> usize {
    (0..).find(|scale| !golden.has(&format!("plane.scale{scale}.0"))).unwrap()
}

fn file_key(plane: usize) -> String {
    format!("scale{}.{}", plane / 6, plane % 6)
}

fn planes_of(golden: &Golden, device: &Device) -> PlaneTensors {
    let planes = (0..6 * scales_of(golden)).map(|i| golden.tensor(&format!("plane.{}", file_key(i)), device));
    PlaneTensors::at_scales(&PlaneAxes::ALL, planes.collect())
}

fn steps_of(golden: &Golden, device: &Device) -> PlaneSteps {
    PlaneSteps::fixed(&vec![golden.scalar("Q"); 6 * scales_of(golden)], device)
}

/// The public code's inter-plane context (NOTES b1): averages over space, with the points of time stretched over the
/// rows.
struct ReferenceInterPlane<'a>(&'a InterScale);

impl ReferenceInterPlane<'_> {
    /// `[M, H, W]` from a space-time plane `[M, T, S]`.
    fn spread(plane: Tensor<3>, [height, width]: [usize; 2]) -> Tensor<3> {
        let [channels, moments, _] = plane.dims();
        let average = plane.mean_dim(2);
        if moments == width && moments != height {
            average.reshape([channels, 1, width]).expand([channels, height, width])
        } else {
            upsample(average, [height, 1]).expand([channels, height, width])
        }
    }

    fn context(planes: &CenteredPlanes, plane: usize) -> Option<Tensor<3>> {
        let [height, width] = planes.layout().planes()[plane].size;
        let sources = planes.layout().over_time(plane)?;
        let maps = sources.map(|source| Self::spread(planes.plane(source), [height, width]));
        let [first, second] = maps;
        Some((first + second) / 2.0)
    }
}

impl PriorPart for ReferenceInterPlane<'_> {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, _: Latent) -> Option<Prior> {
        let parameters = Some(self.0.conv.forward(Self::context(planes, plane)?));
        Some(Prior { parameters, context: None, passes: Passes::AnchorsFirst, latent_bits: None })
    }

    /// The description for the case that points of time are stretched over the rows.
    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        let sources = layout.over_time(plane)?.map(|source| PlaneSource::SameScale(layout.planes()[source].axes));
        let mut layer = self.0.conv.to_layer();
        layer.weight.iter_mut().for_each(|weight| *weight *= 0.5);
        let (mut network, planes) = Network::new([layer.inputs; 2]);
        let [first, second] = planes.map(|plane| {
            let average = network.node(Operation::MeanOverWidth, &[plane]);
            network.node(Operation::Resize, &[average])
        });
        let sum = network.node(Operation::Add, &[first, second]);
        let output = network.layer(sum, layer);
        network.output(output);
        let parameters = Some(DescribedCondition { network, sources: sources.to_vec() });
        Some(DescribedPrior { parameters, context: None, passes: Passes::AnchorsFirst })
    }
}

/// The reference's composition: ours with its inter-plane part before the hyperprior.
fn parts(model: &ContextModel) -> Vec<Box<dyn PriorPart + '_>> {
    let mut parts = model.parts();
    let last = parts.len() - 1;
    parts.insert(last, Box::new(ReferenceInterPlane(model.inter_scale.as_ref().unwrap())));
    parts
}

/// Anchors and the others of `[C, H, W]` (H and W even), each `[2 C, H / 2, W / 2]`: first the values of the even rows,
/// then those of the odd rows.
fn demultiplex(plane: Tensor<3>) -> [Tensor<3>; 2] {
    let [channels, height, width] = plane.dims();
    let split: Tensor<5> = plane.reshape([channels, height / 2, 2, width / 2, 2]);
    let phase = |row: usize, column: usize| {
        let values = split.clone().slice(s![.., .., row..row + 1, .., column..column + 1]);
        values.reshape([channels, height / 2, width / 2])
    };
    [[phase(0, 1), phase(1, 0)], [phase(0, 0), phase(1, 1)]].map(|halves| Tensor::cat(halves.into(), 0))
}

/// The inverse of [`demultiplex`].
fn multiplex(anchors: Tensor<3>, others: Tensor<3>) -> Tensor<3> {
    let [doubled, height, width] = anchors.dims();
    let channels = doubled / 2;
    let phase = |values: &Tensor<3>, half: usize| {
        values.clone().narrow(0, half * channels, channels).reshape([channels, height, 1, width, 1])
    };
    let even: Tensor<5> = Tensor::cat(vec![phase(&others, 0), phase(&anchors, 0)], 4);
    let odd = Tensor::cat(vec![phase(&anchors, 1), phase(&others, 1)], 4);
    Tensor::cat(vec![even, odd], 2).reshape([channels, 2 * height, 2 * width])
}

#[test]
fn masks_and_demultiplexing() {
    let golden = Golden::open("c06_context");
    for (name, device) in devices() {
        let mask = values_of(&checkerboard_kernel(golden.shape("mask5x5")[0], &device));
        assert_eq!(mask, golden.values("mask5x5"), "{name}");
        let x = golden.tensor::<3>("demux.x", &device);
        let [anchors, others] = demultiplex(x.clone());
        assert_eq!(values_of(&anchors), golden.values("demux.anchor"), "{name} anchors");
        assert_eq!(values_of(&others), golden.values("demux.nonanchor"), "{name} others");
        let together = multiplex(anchors, others.zeros_like());
        assert_eq!(values_of(&multiplex(demultiplex(x.clone())[0].clone(), others)), golden.values("demux.remux"));
        let [_, height, width] = x.dims();
        assert_eq!(values_of(&together), values_of(&(x * anchor_mask([height, width], &device))), "{name}");
    }
}

#[test]
fn masked_convolution() {
    let golden = Golden::open("c06_context");
    for (name, device) in devices() {
        let device = device.autodiff();
        let model = model_of(&golden, &device);
        let conv = model.checkerboard.unwrap().conv;
        let x = golden.tensor::<3>("maskconv.x", &device).require_grad();
        let out = conv.forward(x.clone());
        assert_close_relative(&format!("{name} out"), &values_of(&out), &golden.values("maskconv.out"), 1e-4);
        let gradients = (out * golden.tensor("maskconv.w", &device)).sum().backward();
        let expect = |what: &str, found: Vec<f32>, expected: Vec<f32>| {
            assert_close_relative(&format!("{name} {what}"), &found, &expected, 1e-3);
        };
        expect("grad_x", values_of(&x.grad(&gradients).unwrap()), golden.values("maskconv.grad_x"));
        let bias = conv.bias.val().grad(&gradients).unwrap();
        expect("grad_bias", values_of(&bias), golden.values("maskconv.grad_bias"));
        // PyTorch also computes gradients for the taps that the mask then sets to zero; our code does not.
        let mask = golden.values("mask5x5");
        let masked =
            golden.values("maskconv.grad_weight").into_iter().enumerate().map(|(i, g)| g * mask[i % mask.len()]);
        let weight = conv.weight.val().grad(&gradients).unwrap();
        expect("grad_weight", values_of(&weight), masked.collect());
    }
}

#[test]
fn pieces() {
    let golden = Golden::open("c06_context");
    for (name, device) in devices() {
        let model = model_of(&golden, &device);
        let read = |key: &str| golden.tensor::<3>(key, &device);
        let check = |key: &str, found: &Tensor<3>| {
            assert_close_relative(&format!("{name} {key}"), &values_of(found), &golden.values(key), 1e-4);
        };
        let hyperprior = model.hyperprior.as_ref().unwrap();
        let z = hyperprior.analyze(read("hyper.y") / golden.scalar("Q"));
        check("hyper.z", &z);
        check("hyper.params", &hyperprior.synthesize(read("hyper.z")));

        let x = read("entropy_parameters.x");
        let [inputs, height, width] = x.dims();
        let [parameters, context] = [0, inputs / 2].map(|start| Some(x.clone().narrow(0, start, inputs / 2)));
        let found = model.entropy_parameters.forward(parameters, context, [height, width]);
        check("entropy_parameters.out", &Tensor::cat(vec![found.scales(), found.means()], 0));

        for key in ["interscale", "interscale_xt"] {
            let expected = format!("{key}.up");
            let [_, _, height, width] = golden.shape(&expected)[..] else { panic!("{expected} is [1, M, H, W]") };
            check(&expected, &upsample(read(&format!("{key}.lower")), [height, width]));
        }

        let planes = model.centered(&planes_of(&golden, &device), &steps_of(&golden, &device));
        for plane in [0, 1, 3] {
            let [a, b] = planes.layout().over_time(plane).unwrap().map(|source| planes.plane(source));
            check(&format!("interplane_paper.{plane}"), &InterPlane::context(a, b));
            let reference = ReferenceInterPlane::context(&planes, plane).unwrap();
            check(&format!("interplane_ref.{plane}"), &reference);
        }
    }
}

/// The intermediate maps from which the Gaussians of a space-time plane are computed, one for each part.
#[test]
fn trace_of_a_space_time_plane() {
    let golden = Golden::open("c06_context");
    for (name, device) in devices() {
        let model = model_of(&golden, &device);
        let check = |key: &str, found: &Tensor<3>| {
            let key = format!("trace_scale0_plane2.{key}");
            assert_close_relative(&format!("{name} {key}"), &values_of(found), &golden.values(&key), 1e-4);
        };
        let planes = model.centered(&planes_of(&golden, &device), &steps_of(&golden, &device));
        let hyperprior = model.hyperprior.as_ref().unwrap();
        let z = hyperprior.analyze(planes.in_steps(2));
        check("z", &z);
        let parameters = hyperprior.synthesize(z);
        check("params_base", &parameters);
        let plane = planes.plane(2);
        let [_, height, width] = plane.dims();
        let conv = &model.checkerboard.as_ref().unwrap().conv;
        check("ctx_params", &conv.forward(plane.clone() * anchor_mask([height, width], &device)));
        let both = |context: Option<Tensor<3>>| {
            let gaussians = model.entropy_parameters.forward(Some(parameters.clone()), context, [height, width]);
            Tensor::cat(vec![gaussians.scales(), gaussians.means()], 0)
        };
        check("gauss_anchor", &both(None));
        // The file has the second pass at every place; our second pass leaves the anchors' parameters as they are.
        let context = conv.forward(plane * anchor_mask([height, width], &device));
        check("gauss_full", &both(Some(context)));
    }
}

/// Rate without any quantization, and its gradient with respect to planes and weights.
#[test]
fn identity() {
    let golden = Golden::open("c06_context");
    let (bits_y, bits_z) = (golden.values("identity.bits_y"), golden.values("identity.bits_z"));
    for (name, device) in devices() {
        let device = device.autodiff();
        let model = model_of(&golden, &device);
        let leaves = planes_of(&golden, &device).map(|_, plane| plane.require_grad());
        let planes = model.centered(&leaves, &steps_of(&golden, &device));
        let parts = parts(&model);
        let mut total = Tensor::<1>::zeros([1], &device);
        for plane in 0..leaves.len() {
            let rate = model.rate_with(&parts, &planes, plane, Latent::Exact);
            let what = format!("{name} identity {}", file_key(plane));
            assert_close_relative(&format!("{what} y"), &values_of(&rate.values_bits), &bits_y[plane..=plane], 1e-4);
            let hyper = rate.latent_bits.as_ref().map_or(0.0, |bits| values_of(bits)[0]);
            assert_close_relative(&format!("{what} z"), &[hyper], &bits_z[plane..=plane], 1e-4);
            total = total + rate.total();
        }
        drop(parts);
        let found = values_of(&total);
        assert_close_relative(&format!("{name} total"), &found, &golden.values("identity.total_bits"), 1e-4);
        let gradients = total.backward();
        for (plane, leaf) in leaves.iter().enumerate() {
            let key = format!("identity.grad_plane.{}", file_key(plane));
            let gradient = values_of(&leaf.grad(&gradients).unwrap());
            assert_close_relative(&format!("{name} {key}"), &gradient, &golden.values(&key), 1e-3);
        }
        let compared = compare_gradients(name, &model, &gradients, 1e-3, |parameter| {
            let key = format!("identity.grad_param.{}", name_in_file(parameter)?);
            golden.has(&key).then(|| golden.values(&key))
        });
        let density = &model.hyperprior.as_ref().unwrap().bottleneck.density;
        let prefix = "identity.grad_param.entropy_bottleneck.";
        let compared = compared + compare_density(name, density, &gradients, 1e-3, &golden, prefix);
        let in_file = golden.names().iter().filter(|key| key.starts_with("identity.grad_param.")).count();
        assert_eq!(compared, in_file, "{name}: compared parameters");
    }
}

/// Rate of values rounded around their means, with contexts that are not rounded.
#[test]
fn eval() {
    let golden = Golden::open("c06_context");
    let (bits_y, bits_z) = (golden.values("eval.bits_y"), golden.values("eval.bits_z"));
    for (name, device) in devices() {
        let model = model_of(&golden, &device);
        let planes = model.centered(&planes_of(&golden, &device), &steps_of(&golden, &device));
        let parts = parts(&model);
        let mut total = 0.0;
        for plane in 0..planes.layout().len() {
            let (gaussians, hyper) = model.parameters_with(&parts, &planes, plane, Latent::Rounded);
            let rounded = (planes.in_steps(plane) - gaussians.means()).round() + gaussians.means();
            let likelihood = gaussian_likelihood(rounded, gaussians);
            let what = format!("{name} eval {}", file_key(plane));
            let key = format!("eval.likelihood_y.{}", file_key(plane));
            assert_close_relative(&format!("{name} {key}"), &values_of(&likelihood), &golden.values(&key), 1e-4);
            let found = values_of(&bits(likelihood).sum());
            assert_close_relative(&format!("{what} y"), &found, &bits_y[plane..=plane], 1e-4);
            let hyper = hyper.map_or(0.0, |bits| values_of(&bits)[0]);
            assert_close_relative(&format!("{what} z"), &[hyper], &bits_z[plane..=plane], 1e-4);
            total += found[0] + hyper;
        }
        assert_close_relative(&format!("{name} total"), &[total], &golden.values("eval.total_bits"), 1e-4);
    }
}

/// Our quantizer against the planes that CompressAI's decoder returned, and their cost.
#[test]
fn stream() {
    let golden = Golden::open("c06_context");
    for (name, device) in devices() {
        let model = model_of(&golden, &device);
        let planes = planes_of(&golden, &device);
        let quantized = model.quantize_with(&parts(&model), &planes, &steps_of(&golden, &device));
        for plane in planes.layout().coding_order() {
            let decoded = values_of(&quantized[plane].decoded);
            let key = format!("stream.decoded.{}", file_key(plane));
            assert_close(&format!("{name} {key}"), &decoded, &golden.values(&key), 1e-4);
            // A stream ends in whole words.
            let found = values_of(&quantized[plane].rate.values_bits)[0];
            let stream = golden.values("stream.bits_y")[plane];
            assert!((found - stream).abs() < 0.01 * stream + 128.0, "{name} {key}: {found} bits against {stream}");
        }
    }
}
