//! A part of the context model of one's own: the plane xz is predicted from what the plane xy, decoded before, is like on
//! average at each x. Nothing of Light4GS is edited, and the codec runs the part exactly.
//!
//! A [`PriorPart`] says the same thing twice: `prior` computes it with Burn, for training; `describe` gives it to the codec
//! as a list of layers. A model is a list of parts, and for each plane the first that applies speaks.

use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::network::Operation;
use light4gs_codec::{Network, PlaneCoding, PlaneSource, encode_planes, plane_distributions};
use light4gs_examples::{Outcome, first_and_last};
use light4gs_model::{
    CenteredPlanes, ContextModel, ContextModelConfig, DescribedCondition, DescribedPrior, HexPlane, HexPlaneConfig,
    Latent, Passes, PlaneConv, PlaneConvConfig, PlaneSteps, Prior, PriorPart,
};

/// Places of these planes among the six of a scale.
const XY: usize = 0;
const XZ: usize = 1;
/// Channels of a plane.
const CHANNELS: usize = 4;

/// xz from the mean of xy over y.
#[derive(Module, Debug)]
struct ProfileAlongX {
    /// `[M, H, W]` to `[2 M, H, W]`: scales and means.
    conv: PlaneConv,
}

impl PriorPart for ProfileAlongX {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, _: Latent) -> Option<Prior> {
        // Of the lowest scale alone; above, the plane one scale below says more.
        if plane != XZ {
            return None;
        }
        let [channels, height, width] = planes.planes[plane].dims();
        // xy is [M, y, x]. Its mean over the rows is spread over the rows of xz, [M, z, x].
        let profile = planes.in_same_scale(plane, XY).mean_dim(1).expand([channels, height, width]);
        let parameters = Some(self.conv.forward(profile));
        Some(Prior { parameters, context: None, passes: Passes::AnchorsFirst, hyper_bits: None })
    }

    fn describe(&self, plane: usize) -> Option<DescribedPrior> {
        if plane != XZ {
            return None;
        }
        let (mut network, [xy]) = Network::new([CHANNELS as u32]);
        let profile = network.node(Operation::MeanOverHeight, &[xy]);
        let profile = network.node(Operation::Spread, &[profile]);
        let parameters = network.layer(profile, self.conv.to_layer());
        network.output(parameters);
        let parameters = Some(DescribedCondition { network, sources: vec![PlaneSource::SameScale(XY as u8)] });
        Some(DescribedPrior { parameters, context: None, passes: Passes::AnchorsFirst })
    }
}

/// The usual context model, with our part in front.
#[derive(Module, Debug)]
struct ModelWithProfile {
    usual: ContextModel,
    profile: ProfileAlongX,
}

impl ModelWithProfile {
    fn parts(&self) -> Vec<Box<dyn PriorPart + '_>> {
        let mut parts = self.usual.parts();
        parts.insert(0, Box::new(&self.profile));
        parts
    }
}

/// Planes of one scale in which xz repeats, with a little noise, the profile of xy along x.
fn planes(device: &Device) -> Vec<Tensor<3>> {
    let hexplane = HexPlaneConfig::new().with_channels(CHANNELS).with_resolution([16, 12, 20, 8]);
    let mut planes = hexplane.with_multipliers(vec![1]).init(device).tensors();
    let normal = |shape, width| Tensor::<3>::random(shape, Distribution::Normal(0.0, width), device);
    let profile = normal([CHANNELS, 1, 16], 0.5);
    planes[XY] = profile.clone().expand([CHANNELS, 12, 16]) + normal([CHANNELS, 12, 16], 0.1);
    planes[XZ] = profile.expand([CHANNELS, 20, 16]) + normal([CHANNELS, 20, 16], 0.1);
    planes
}

fn main() -> Outcome {
    let device = Device::flex();
    device.seed(0);
    let planes = planes(&device);
    let steps = PlaneSteps::fixed(&[0.05; 6], &device);

    // Trained: the bits of xz under the usual model and under ours. (A training of a scene adds them to its loss.)
    let tape = device.clone().autodiff();
    let usual = ContextModelConfig::compact(CHANNELS).init(&tape);
    let profile = ProfileAlongX { conv: PlaneConvConfig::new(CHANNELS, 2 * CHANNELS, 1).init(&tape) };
    let mut model = ModelWithProfile { usual, profile };
    let on_tape: Vec<Tensor<3>> = planes.iter().cloned().map(Tensor::from_inner).collect();
    let steps_on_tape = PlaneSteps::fixed(&[0.05; 6], &tape);
    model.usual.start_from(&on_tape, &steps_on_tape);
    let mut optimizer = AdamConfig::new().init();
    let mut history = Vec::new();
    for _ in 0..200 {
        let noisy = model.usual.centered(&steps_on_tape.add_noise(&on_tape), &steps_on_tape);
        let bits = model.usual.rate_with(&model.parts(), &noisy, XZ, Latent::Noise).total();
        history.push(bits.clone().into_scalar::<f32>());
        let gradients = GradientsParams::from_grads(bits.backward(), &model);
        model = optimizer.step(1e-2, model, gradients);
    }
    let mut model = model.valid();
    model.usual.update_quantiles();
    let values = planes[XZ].shape().num_elements() as f32;
    let (first, last) = first_and_last(&history);
    println!("xz: {:.2} bits a value at first, {:.2} in the end", first / values, last / values);
    assert!(last < 0.8 * first);

    // Coded: the composition as data, and the planes as a decoder will have them.
    let quantized = model.usual.quantize_with(&model.parts(), &planes, &steps);
    let expected = quantized[XZ].rate.values_bits.clone().into_scalar::<f32>();
    let decoded: Vec<Tensor<3>> = quantized.into_iter().map(|plane| plane.decoded).collect();
    let symbols = |latent: Tensor<3>| latent.into_data().iter::<f32>().map(|symbol| symbol as i32).collect();
    let latents = model.usual.latent_symbols(&planes, &steps).into_iter();
    let coding = PlaneCoding {
        model: model.usual.to_arrays_with(&model.parts())?,
        steps: steps.to_groups(),
        latent_symbols: latents.map(|latent| latent.map_or_else(Vec::new, symbols)).collect(),
    };
    let arrays = HexPlane::from_planes(decoded.clone()).to_arrays();
    println!(
        "{} bytes for all planes; {:.2} bits expected for a value of xz",
        encode_planes(&arrays, &coding)?.len(),
        expected / values
    );

    // The codec's exact executor says what the Burn module says, to float tolerance.
    let exact = plane_distributions(&arrays, &coding, XZ)?;
    let known = model.usual.centered(&decoded, &steps);
    let (ours, _) = model.usual.parameters_with(&model.parts(), &known, XZ, Latent::Rounded);
    for (ours, exact) in [(ours.means, exact.means), (ours.scales, exact.scales)] {
        let ours: Vec<f32> = ours.into_data().iter::<f32>().collect();
        let worst = ours.iter().zip(&exact).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max);
        println!("largest relative difference between Burn and the codec: {worst:e}");
        assert!(worst < 1e-4);
    }
    Ok(())
}
