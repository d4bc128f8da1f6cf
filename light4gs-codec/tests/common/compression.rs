//! Context models, tables and networks of random numbers that follow from a seed.

use light4gs_codec::{
    CompressionInput, Condition, ContextModelArrays, FeaturePlaneArrays, FrequencyTable, LatentArrays, Network,
    PerGroup, PlaneCoding, PlanePrior, PlaneSource, Profile, SceneData, ShCoding, ShPrior, ShSource,
    attributes::AttributeSteps,
    network::{Layer, LayerKind, Operation, Value},
    plane_layout::PlaneLayout,
    sh_rest_coefficients,
};

use super::{further, hexplane, sample};

/// A linear congruential generator.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x1234_5678)
    }

    /// Uniform in [-1, 1).
    pub fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    /// Roughly normal, of variance 1.
    pub fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.uniform()).sum::<f32>() * 0.5
    }

    pub fn normals(&mut self, count: usize, scale: f32) -> Vec<f32> {
        (0..count).map(|_| scale * self.normal()).collect()
    }
}

/// The parts of a model. The codec itself has no such parts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parts {
    pub hyperprior: bool,
    pub checkerboard: bool,
    pub inter_plane: bool,
    pub inter_scale: bool,
    pub high_scale_hyperprior: bool,
}

pub const ALL_PARTS: Parts =
    Parts { hyperprior: true, checkerboard: true, inter_plane: true, inter_scale: true, high_scale_hyperprior: false };

/// Sizes of a model.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub channels: u32,
    pub latent_channels: u32,
    pub synthesis: [u32; 2],
    pub hidden: [u32; 2],
    pub context_groups: u32,
    /// Kernel and groups.
    pub inter_plane: [u32; 2],
    /// Kernel and groups.
    pub inter_scale: [u32; 2],
    pub parts: Parts,
    pub centers: PerGroup,
}

/// A small model: depthwise spatial convolutions, narrow pointwise ones.
pub fn compact_shape(channels: u32, parts: Parts) -> Shape {
    Shape {
        channels,
        latent_channels: (channels / 8).max(1),
        synthesis: [channels.div_ceil(2), channels],
        hidden: [2 * channels, 2 * channels],
        context_groups: channels,
        inter_plane: [3, 2 * channels],
        inter_scale: [3, channels],
        parts,
        centers: PerGroup { space_only: 0.0, space_time: 1.0 },
    }
}

/// The sizes of the public code.
pub fn reference_shape(channels: u32, parts: Parts) -> Shape {
    Shape {
        latent_channels: (channels / 8).max(1),
        synthesis: [channels, channels * 3 / 2],
        hidden: [channels * 10 / 3, channels * 8 / 3],
        context_groups: 1,
        inter_plane: [5, 1],
        inter_scale: [5, 1],
        centers: PerGroup::default(),
        ..compact_shape(channels, parts)
    }
}

impl Random {
    /// Random weights that keep the magnitude of their inputs.
    pub fn layer(&mut self, kind: LayerKind, inputs: u32, outputs: u32, kernel: u32, groups: u32) -> Layer {
        let mut layer = Layer { kind, inputs, outputs, kernel, groups, weight: Vec::new(), bias: Vec::new() };
        let fan_in = (inputs / groups * kernel * kernel) as f32;
        layer.weight = self.normals(layer.weights() as usize, 1.0 / fan_in.sqrt());
        if kind == LayerKind::Checkerboard {
            // As a decoder gets them.
            let masked = |at: usize| (at / kernel as usize + at % kernel as usize).is_multiple_of(2);
            let area = (kernel * kernel) as usize;
            layer
                .weight
                .iter_mut()
                .enumerate()
                .filter(|(at, _)| masked(at % area))
                .for_each(|(_, weight)| *weight = 0.0);
        }
        layer.bias = self.normals(outputs as usize, 0.1);
        layer
    }

    pub fn linear(&mut self, inputs: u32, outputs: u32) -> Layer {
        self.layer(LayerKind::Convolution, inputs, outputs, 1, 1)
    }
}

/// A condition that is network `network`.
pub fn condition(network: u32, sources: &[PlaneSource]) -> Option<Condition> {
    Some(Condition { network, sources: sources.to_vec() })
}

/// `2M` and `2M` channels through two hidden layers to `2M`.
pub fn distribution(random: &mut Random, channels: u32, [first, second]: [u32; 2]) -> Network {
    let (mut network, inputs) = Network::new([2 * channels, 2 * channels]);
    let mut value = network.node(Operation::Concatenate, &inputs);
    for (inputs, outputs) in [(4 * channels, first), (first, second)] {
        value = network.layer(value, random.linear(inputs, outputs));
        value = network.leaky_relu(value, 0.01);
    }
    let mut last = random.linear(second, 2 * channels);
    last.bias[..channels as usize].iter_mut().for_each(|scale| *scale += 1.0);
    value = network.layer(value, last);
    network.output(value);
    network
}

/// A context model of random weights for planes.
pub fn model(shape: Shape, planes: &FeaturePlaneArrays, seed: u64) -> ContextModelArrays {
    let Shape { channels: m, latent_channels, synthesis: [a, b], hidden, parts, centers, .. } = shape;
    let mut random = Random::new(seed);
    let mut networks = Vec::new();
    let mut add = |network: Network| {
        networks.push(network);
        networks.len() as u32 - 1
    };
    let one = |inputs: u32, build: &mut dyn FnMut(&mut Network, Value) -> Value| {
        let (mut network, [input]) = Network::new([inputs]);
        let output = build(&mut network, input);
        network.output(output);
        network
    };
    let synthesis = parts.hyperprior.then(|| {
        add(one(latent_channels, &mut |network, latent| {
            let half = network.layer(latent, random.layer(LayerKind::Doubling, latent_channels, a, 5, 1));
            let half = network.leaky_relu(half, 0.01);
            let whole = network.layer(half, random.layer(LayerKind::Doubling, a, b, 5, 1));
            let whole = network.leaky_relu(whole, 0.01);
            network.layer(whole, random.layer(LayerKind::Convolution, b, 2 * m, 3, 1))
        }))
    });
    let checkerboard = parts.checkerboard.then(|| {
        add(one(m, &mut |network, anchors| {
            network.layer(anchors, random.layer(LayerKind::Checkerboard, m, 2 * m, 5, shape.context_groups))
        }))
    });
    let inter_plane = parts.inter_plane.then(|| {
        let (mut network, [first, second]) = Network::new([m, m]);
        let across = network.node(Operation::MeanOverHeight, &[first]);
        let across = network.node(Operation::Spread, &[across]);
        let down = network.node(Operation::MeanOverHeight, &[second]);
        let down = network.node(Operation::Transpose, &[down]);
        let down = network.node(Operation::Spread, &[down]);
        let both = network.node(Operation::Concatenate, &[across, down]);
        let [kernel, groups] = shape.inter_plane;
        let output = network.layer(both, random.layer(LayerKind::Convolution, 2 * m, 2 * m, kernel, groups));
        network.output(output);
        add(network)
    });
    let inter_scale = parts.inter_scale.then(|| {
        let [kernel, groups] = shape.inter_scale;
        add(one(m, &mut |network, lower| {
            let resized = network.node(Operation::Resize, &[lower]);
            network.layer(resized, random.layer(LayerKind::Convolution, m, 2 * m, kernel, groups))
        }))
    });
    let distribution = add(distribution(&mut random, m, hidden));

    let latent = |network: Option<u32>| network.and_then(|network| condition(network, &[PlaneSource::Latent]));
    let anchors = || checkerboard.and_then(|network| condition(network, &[PlaneSource::Anchors]));
    let lower = || inter_scale.and_then(|network| condition(network, &[PlaneSource::LowerScale]));
    let layout: PlaneLayout = planes.layout().unwrap();
    let prior = |plane: usize| {
        let higher = layout.one_scale_below(plane).is_some();
        let conditions = match (layout.over_time(plane), inter_plane) {
            _ if higher && parts.high_scale_hyperprior => vec![latent(synthesis), lower()],
            _ if higher && parts.inter_scale => vec![lower(), None],
            (Some(over_time), Some(network)) => {
                let sources = over_time.map(|plane| PlaneSource::SameScale(layout.planes()[plane].axes));
                vec![condition(network, &sources), anchors()]
            }
            _ => vec![latent(synthesis), anchors()],
        };
        PlanePrior { conditions, distribution }
    };
    let mut priors: Vec<PlanePrior> = Vec::new();
    let mut place = |prior: PlanePrior| {
        let place = priors.iter().position(|other| *other == prior).unwrap_or(priors.len());
        if place == priors.len() {
            priors.push(prior);
        }
        place as u32
    };
    let plane_priors = (0..layout.len()).map(|plane| place(prior(plane))).collect();
    let latent = parts.hyperprior.then(|| LatentArrays {
        tables: (0..latent_channels).map(|_| laplace_table(0.5)).collect(),
        medians: random.normals(latent_channels as usize, 0.3),
    });
    ContextModelArrays { channels: m, centers, latent, networks, priors, plane_priors }
}

/// The table of `p(k) ~ decay^|k|`.
pub fn laplace_table(decay: f64) -> FrequencyTable {
    let norm = (1.0 - decay) / (1.0 + decay);
    let pmf: Vec<f64> = (-40..=40i32).map(|k| norm * decay.powi(k.abs())).collect();
    FrequencyTable::from_pmf(-40, &pmf).unwrap()
}

/// A symbol under [`laplace_table`], rarely one beyond it.
pub fn laplace_symbol(random: &mut Random, decay: f64) -> i32 {
    let uniform = f64::from(random.uniform());
    let magnitude = ((1.0 - uniform.abs()).max(1e-9).ln() / decay.ln()) as i32;
    if uniform < 0.0 { -magnitude } else { magnitude }
}

/// Coding of planes with a model.
pub fn plane_coding(planes: &FeaturePlaneArrays, model: ContextModelArrays, steps: Vec<PerGroup>) -> PlaneCoding {
    let mut random = Random::new(77);
    let sizes: Vec<_> = planes.planes.iter().map(|plane| [plane.height, plane.width]).collect();
    let latent_symbols = PlaneCoding::latent_shapes(&model, &sizes)
        .into_iter()
        .map(|shape| {
            let count = shape.map_or(0, |shape| shape.into_iter().product::<u32>());
            (0..count).map(|_| laplace_symbol(&mut random, 0.5)).collect()
        })
        .collect();
    PlaneCoding { model, steps, latent_symbols }
}

/// The same step for both groups.
pub fn step(step: f32) -> Vec<PerGroup> {
    vec![PerGroup { space_only: step, space_time: step }]
}

/// One table for each channel.
pub fn sh_tables(degree: u8) -> ShCoding {
    ShCoding::Tables { step: 0.02, tables: vec![laplace_table(0.6); 3 * sh_rest_coefficients(degree)] }
}

/// The sources of the networks of [`sh_networks`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShKind {
    /// Degree by degree, from the color and all lower degrees.
    Autoregressive,
    /// One network, from the space-only planes.
    HexPlaneCoupled,
    /// One network for each degree, from all sources.
    Everything,
}

/// Networks for a degree; `features` are channels times scales.
pub fn sh_networks(kind: ShKind, degree: u8, features: usize) -> ShCoding {
    let mut random = Random::new(5);
    let mut prior = |sources: &[(ShSource, u32)], channels: u32| {
        let mut network = Network { inputs: sources.iter().map(|source| source.1).collect(), ..Network::default() };
        let inputs: Vec<_> = (0..sources.len() as u32).map(Value).collect();
        let known = if inputs.len() > 1 { network.node(Operation::Concatenate, &inputs) } else { inputs[0] };
        let hidden = network.layer(known, random.linear(network.inputs.iter().sum(), 6));
        let hidden = network.leaky_relu(hidden, 0.01);
        let output = network.layer(hidden, random.linear(6, 2 * channels));
        network.output(output);
        ShPrior { network, sources: sources.iter().map(|source| source.0).collect() }
    };
    let degrees = 1..=u32::from(degree);
    let features = (ShSource::SpaceFeatures, features as u32);
    let priors = match kind {
        ShKind::HexPlaneCoupled if degree == 0 => Vec::new(),
        ShKind::HexPlaneCoupled => vec![prior(&[features], 3 * sh_rest_coefficients(degree) as u32)],
        _ => degrees
            .map(|degree| {
                let mut sources = vec![(ShSource::Dc, 3)];
                if degree > 1 {
                    sources.push((ShSource::Decoded, 3 * (degree * degree - 1)));
                }
                if kind == ShKind::Everything {
                    let single = [
                        (ShSource::Position, 3),
                        (ShSource::LogScale, 3),
                        (ShSource::Quaternion, 4),
                        (ShSource::OpacityLogit, 1),
                    ];
                    sources.extend(single);
                    sources.push(features);
                }
                prior(&sources, 3 * (2 * degree + 1))
            })
            .collect(),
    };
    ShCoding::Networks { step: 0.02, priors }
}

/// A scene of random numbers of sensible sizes.
pub fn scene(count: usize, sh_degree: u8, channels: u32, resolution: [u32; 4], multipliers: &[u32]) -> SceneData {
    let mut random = Random::new(11);
    let mut scene = sample();
    let gaussians = &mut scene.gaussians;
    gaussians.means = (0..count).map(|_| std::array::from_fn(|_| random.normal())).collect();
    gaussians.log_scales = (0..count).map(|_| std::array::from_fn(|_| random.normal() - 4.0)).collect();
    gaussians.quats = (0..count).map(|_| std::array::from_fn(|_| random.normal())).collect();
    gaussians.opacity_logits = random.normals(count, 2.0);
    gaussians.sh_dc = (0..count).map(|_| std::array::from_fn(|_| random.normal())).collect();
    gaussians.sh_degree = sh_degree;
    gaussians.sh_rest = (0..count * 3 * sh_rest_coefficients(sh_degree))
        .map(|_| 0.02 * laplace_symbol(&mut random, 0.6) as f32 + 0.004 * random.uniform())
        .collect();
    gaussians.further = vec![further("age", 2, count), further("label", 1, count)];
    scene.feature_planes = hexplane(channels, resolution, multipliers);
    fill(scene, random)
}

/// The scene over other planes.
pub fn with_planes(mut scene: SceneData, planes: FeaturePlaneArrays) -> SceneData {
    scene.feature_planes = planes;
    fill(scene, Random::new(12))
}

/// Random planes, and a motion that reads them.
fn fill(mut scene: SceneData, mut random: Random) -> SceneData {
    scene.motion = match scene.feature_planes.features() as u32 {
        0 => Default::default(),
        features => super::motion(features),
    };
    for plane in &mut scene.feature_planes.planes {
        let center = if plane.axes.is_space_time() { 1.0 } else { 0.0 };
        plane.values.fill_with(|| center + 0.1 * random.normal());
    }
    scene
}

/// All parts; tables for the spherical harmonics.
pub fn input(scene: &SceneData, profile: Profile, shape: Shape) -> CompressionInput {
    CompressionInput {
        profile,
        planes: Some(plane_coding(&scene.feature_planes, model(shape, &scene.feature_planes, 3), step(0.1))),
        sh: sh_tables(scene.gaussians.sh_degree),
        // The attribute `label` has no step.
        attributes: AttributeSteps::default().with("age", 0.01),
        weights: Default::default(),
        layers: Default::default(),
    }
}

/// Two small scenes and their coding. In the two together every kind of data occurs.
pub fn tiny(profile: Profile) -> (SceneData, CompressionInput) {
    let scene = scene(6, 2, 4, [8, 4, 4, 4], &[1, 2]);
    let (shape, kind) = match profile {
        Profile::Compact => (compact_shape(4, ALL_PARTS), Some(ShKind::Autoregressive)),
        Profile::Paper => {
            let parts = Parts { high_scale_hyperprior: true, ..ALL_PARTS };
            (Shape { inter_scale: [3, 4], ..reference_shape(4, parts) }, None)
        }
    };
    let mut input = input(&scene, profile, shape);
    if let Some(kind) = kind {
        input.sh = sh_networks(kind, 2, 8);
    }
    (scene, input)
}
