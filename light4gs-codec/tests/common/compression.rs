//! Context models, tables and networks of random numbers that follow from a seed.

use light4gs_codec::{
    CompressionInput, ContextModelArrays, ContextModelShape, ContextParts, ConvolutionLayer, FrequencyTable,
    HexPlaneArrays, LinearLayer, PerGroup, PlaneCoding, Profile, SceneData, ShCoding, ShCondition, SpatialKernel,
    sh_rest_coefficients,
};

use super::{hexplane, sample};

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

    /// About normal, of variance 1.
    pub fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.uniform()).sum::<f32>() * 0.5
    }

    pub fn normals(&mut self, count: usize, scale: f32) -> Vec<f32> {
        (0..count).map(|_| scale * self.normal()).collect()
    }
}

pub const ALL_PARTS: ContextParts = ContextParts {
    hyperprior: true,
    checkerboard: true,
    inter_plane: true,
    inter_scale: true,
    high_scale_hyperprior: false,
};

/// A small model: depthwise spatial convolutions, narrow pointwise ones.
pub fn compact_shape(channels: u32, parts: ContextParts) -> ContextModelShape {
    ContextModelShape {
        channels,
        hyper_channels: (channels / 8).max(1),
        synthesis_channels: [channels.div_ceil(2), channels],
        parameter_channels: [2 * channels, 2 * channels],
        context_groups: channels,
        inter_plane: SpatialKernel { kernel: 3, groups: 2 * channels },
        inter_scale: SpatialKernel { kernel: 3, groups: channels },
        parts,
        centres: PerGroup { space_only: 0.0, space_time: 1.0 },
    }
}

/// The sizes of the public code.
pub fn reference_shape(channels: u32, parts: ContextParts) -> ContextModelShape {
    ContextModelShape {
        hyper_channels: (channels / 8).max(1),
        synthesis_channels: [channels, channels * 3 / 2],
        parameter_channels: [channels * 10 / 3, channels * 8 / 3],
        context_groups: 1,
        inter_plane: SpatialKernel { kernel: 5, groups: 1 },
        inter_scale: SpatialKernel { kernel: 5, groups: 1 },
        centres: PerGroup::default(),
        ..compact_shape(channels, parts)
    }
}

/// Random weights that keep the size of what they are applied to.
pub fn model(shape: ContextModelShape, seed: u64) -> ContextModelArrays {
    let mut random = Random::new(seed);
    let layers = shape
        .layers()
        .into_iter()
        .map(|shape| {
            let fan_in = (shape.inputs / shape.groups * shape.kernel * shape.kernel) as f32;
            let weight = random.normals(shape.weights() as usize, 1.0 / fan_in.sqrt());
            let mut bias = random.normals(shape.outputs as usize, 0.1);
            if shape.name == "entropy_parameters.4" {
                let scales = shape.outputs as usize / 2;
                bias[..scales].iter_mut().for_each(|scale| *scale += 1.0);
            }
            ConvolutionLayer { shape, weight, bias }
        })
        .collect();
    let hyper = if shape.parts.hyperprior { shape.hyper_channels as usize } else { 0 };
    ContextModelArrays {
        shape,
        layers,
        hyper_tables: (0..hyper).map(|_| laplace_table(0.5)).collect(),
        hyper_medians: random.normals(hyper, 0.3),
    }
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

/// Coding of a hexplane with a model.
pub fn plane_coding(hexplane: &HexPlaneArrays, model: ContextModelArrays, steps: Vec<PerGroup>) -> PlaneCoding {
    let mut random = Random::new(77);
    let sizes: Vec<_> = hexplane.planes.iter().map(|plane| [plane.height, plane.width]).collect();
    let hyper_symbols = PlaneCoding::hyper_shapes(&model.shape, &sizes)
        .into_iter()
        .map(|shape| {
            let count = shape.map_or(0, |shape| shape.into_iter().product::<u32>());
            (0..count).map(|_| laplace_symbol(&mut random, 0.5)).collect()
        })
        .collect();
    PlaneCoding { model, steps, hyper_symbols }
}

/// Both steps alike.
pub fn step(step: f32) -> Vec<PerGroup> {
    vec![PerGroup { space_only: step, space_time: step }]
}

/// A table a channel.
pub fn sh_tables(degree: u8) -> ShCoding {
    ShCoding::Tables { step: 0.02, tables: vec![laplace_table(0.6); 3 * sh_rest_coefficients(degree)] }
}

fn linear(random: &mut Random, name: String, inputs: usize, outputs: usize) -> LinearLayer {
    LinearLayer {
        name,
        inputs: inputs as u32,
        outputs: outputs as u32,
        weight: random.normals(inputs * outputs, 1.0 / (inputs as f32).sqrt()),
        bias: random.normals(outputs, 0.5),
    }
}

/// Networks for a degree; `features` are channels times scales.
pub fn sh_networks(kind: ShCondition, degree: u8, features: usize) -> ShCoding {
    let mut random = Random::new(5);
    let mut layers = Vec::new();
    let mut network = |name: String, inputs: usize, outputs: usize| {
        layers.push(linear(&mut random, format!("{name}.0"), inputs, 6));
        layers.push(linear(&mut random, format!("{name}.2"), 6, 2 * outputs));
    };
    match kind {
        ShCondition::Autoregressive => {
            for degree in 1..=usize::from(degree) {
                network(format!("sh_ar.{}", degree - 1), 3 * degree * degree, 3 * (2 * degree + 1));
            }
        }
        ShCondition::HexplaneCoupled if degree > 0 => {
            network("sh_hex".into(), features, 3 * sh_rest_coefficients(degree));
        }
        ShCondition::HexplaneCoupled => {}
    }
    ShCoding::Conditional { step: 0.02, kind, layers }
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
    scene.hexplane = hexplane(channels, resolution, multipliers);
    for (index, plane) in scene.hexplane.planes.iter_mut().enumerate() {
        let centre = if [2, 4, 5].contains(&(index % 6)) { 1.0 } else { 0.0 };
        plane.values.fill_with(|| centre + 0.1 * random.normal());
    }
    scene
}

/// All parts, tables for the harmonics.
pub fn input(scene: &SceneData, profile: Profile, shape: ContextModelShape) -> CompressionInput {
    CompressionInput {
        profile,
        planes: Some(plane_coding(&scene.hexplane, model(shape, 3), step(0.1))),
        sh: sh_tables(scene.gaussians.sh_degree),
        attributes: Default::default(),
        weights: Default::default(),
    }
}

/// Two small scenes and how to code them, with something of everything between them.
pub fn tiny(profile: Profile) -> (SceneData, CompressionInput) {
    let scene = scene(6, 2, 4, [8, 4, 4, 4], &[1, 2]);
    let (shape, kind) = match profile {
        Profile::Compact => (compact_shape(4, ALL_PARTS), Some(ShCondition::Autoregressive)),
        Profile::Paper => {
            let parts = ContextParts { high_scale_hyperprior: true, ..ALL_PARTS };
            (
                ContextModelShape { inter_scale: SpatialKernel { kernel: 3, groups: 4 }, ..reference_shape(4, parts) },
                None,
            )
        }
    };
    let mut input = input(&scene, profile, shape);
    if let Some(kind) = kind {
        input.sh = sh_networks(kind, 2, 8);
    }
    (scene, input)
}
