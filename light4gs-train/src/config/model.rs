//! `[model]`: what is trained.

use light4gs_model::{
    BuiltInFieldConfig, DeformationField, DynamicSceneConfig, GaussiansConfig, HexPlaneFieldConfig, MOST_AFFINITIES,
    MOST_NODES, NodesFieldConfig,
};

use crate::keys::Bounds::{self, Flag, Kind, List, Number, Whole};
use crate::keys::{WEIGHT, choice, keys};

/// Far above anything useful: a mistyped number must not ask for the machine's whole memory.
pub(super) const MOST_PLANE_RESOLUTION: u64 = 4096;

keys! {
    /// What is trained.
    pub struct ModelConfig {
        /// Highest degree of the spherical harmonics, 0 to 3.
        sh_degree: u8 = 3; Whole { least: 0, most: 3 }, "3DGS";
        /// What moves the Gaussians: `"hexplane"`, of which `model.hexplane` and `model.deformation` are the keys,
        /// `"nodes"`, of which `model.nodes` are the keys, or `"still"`, nothing.
        field: FieldKind = FieldKind::HexPlane;
            Kind { names: FieldKind::NAMES, list: "light4gs-train/src/config/model.rs" },
            "paper", "or \"nodes\", which Gaussians follow; \"still\": nothing moves";
        /// From world coordinates to those of the planes.
        coordinates: CoordinatesTable;
        /// The feature planes.
        hexplane: HexPlaneTable;
        /// The network that turns features into motion.
        deformation: DeformationTable;
        /// The control nodes.
        nodes: NodesTable;
    }
}

choice! {
    /// The built-in deformation fields.
    pub enum FieldKind: "field" {
        /// The paper's: hexplane and network.
        HexPlane = "hexplane",
        /// Control nodes, which Gaussians follow.
        Nodes = "nodes",
        /// Nothing moves.
        Still = "still",
    }
}

keys! {
    /// From world coordinates to those of the planes (paper III-A).
    pub struct CoordinatesTable {
        /// The planes lie along the principal axes of the initial cloud. Off: along the world's axes, scaled by the
        /// cloud's standard deviation along each.
        pca: bool = light4gs_model::CoordinatesConfig::default().pca;
            Flag, "paper", "along the principal axes of the initial cloud; false = along the world's";
        /// Points more than one standard deviation away from the cloud's center are contracted. Off: the whole cloud is
        /// scaled into the ball that contraction does not change, which is half as wide as the planes.
        contraction: bool = light4gs_model::CoordinatesConfig::default().contraction;
            Flag, "paper", "false = the whole cloud is scaled into what is not contracted";
    }
}

keys! {
    /// Sizes of the multiscale hexplane.
    pub struct HexPlaneTable {
        /// Number of features of a plane.
        channels: usize = light4gs_model::HexPlaneConfig::new().channels;
            Whole { least: 1, most: 1024 }, "paper: 32 for D-NeRF, 16 for real scenes";
        /// Resolution along x, y, z, t at the lowest scale. Multiples of 4.
        resolution: [usize; 4] = light4gs_model::HexPlaneConfig::new().resolution;
            List { element: &Whole { least: 4, most: MOST_PLANE_RESOLUTION }, length: Some(4) },
            "paper; its 25 time steps are no multiple of 4", "x, y, z, t; multiples of 4";
        /// One scale of planes for each number, ascending. The spatial resolution is the base resolution times the
        /// number; the resolution in time stays the same.
        multipliers: Vec<usize> = light4gs_model::HexPlaneConfig::new().multipliers;
            List { element: &Whole { least: 1, most: MOST_PLANE_RESOLUTION / 4 }, length: None },
            "paper", "spatial axes only";
    }
}

keys! {
    /// Sizes and heads of the deformation network.
    pub struct DeformationTable {
        /// Width of the deformation network.
        width: usize = network().width; Whole { least: 1, most: 4096 }, "paper, D-NeRF";
        /// Layers before the heads. 0 means the same as 1.
        depth: usize = network().depth; Whole { least: 0, most: 64 }, "reference";
        /// Positions move.
        position: bool = network().position; Flag, "reference";
        /// Scales change.
        scale: bool = network().scale; Flag, "reference";
        /// Rotations change.
        rotation: bool = network().rotation; Flag, "reference";
        /// Opacities change.
        opacity: bool = network().opacity; Flag, "reference: off for D-NeRF and HyperNeRF, on for Neu3D";
        /// Spherical harmonics change.
        sh: bool = network().sh; Flag, "reference: off for D-NeRF and HyperNeRF, on for Neu3D";
        /// Positions get a gradient through the hexplane query as well. Off is what the reference does.
        differentiate_points: bool = true; Flag, "ours";
    }
}

keys! {
    /// Control nodes, and their trajectories.
    pub struct NodesTable {
        /// Nodes, or as many as there are Gaussians if those are fewer.
        count: usize = nodes().nodes; Whole { least: 1, most: MOST_NODES as u64 }, "ours; SC-GS: 512";
        /// Training times between two knots of a trajectory.
        times_a_knot: f64 = nodes().times_a_knot; Number { least: 0.1, most: 1e6 }, "ours";
        /// A node's radius at the beginning, as a share of the distance to the nearest other one.
        radius: f64 = nodes().radius; Number { least: 0.01, most: 100.0 }, "ours";
        /// Nodes are placed where Gaussians are at least so opaque.
        opacity: f64 = nodes().opacity; Number { least: 1e-4, most: 0.999 }, "ours";
        /// Every Gaussian learns how still it stands.
        stillness: bool = nodes().stillness.is_some(); Flag, "ours", "every Gaussian learns how still it stands";
        /// The logit of standing still at the beginning, where 0 is that of a node's own place.
        stillness_start: f64 = nodes().stillness.unwrap_or(-4.0); Number { least: -30.0, most: 30.0 }, "ours";
        /// Every Gaussian learns when it is there: its opacity is multiplied by a bell curve over time. From the iteration on
        /// at which the sampler's window holds all times.
        lifetime: bool = nodes().lifetime; Flag, "ours", "every Gaussian learns when it is there";
        /// Numbers by which every Gaussian learns which nodes it follows beyond its place: a foot and the floor under it need
        /// not move together.
        affinities: usize = nodes().affinities; Whole { least: 0, most: MOST_AFFINITIES as u64 }, "after SC-GS",
            "numbers by which every Gaussian learns which nodes it follows beyond its place";
        /// Weight of the term that keeps neighboring nodes in place as seen from each other.
        rigidity: f64 = nodes().rigidity; WEIGHT, "ours; SC-GS: 1e-4 to 0";
        /// Weight of the squared second differences of trajectories.
        smoothness: f64 = nodes().smoothness; WEIGHT, "ours";
        /// How much faster than the deformation's rate translations are learned, as shares of the scene's extent.
        translation_rate: f64 = nodes().translation_rate; FACTOR, "ours";
        /// How much faster than the deformation's rate rotations are learned.
        rotation_rate: f64 = nodes().rotation_rate; FACTOR, "ours";
        /// How much faster than the deformation's rate the nodes' places and radii are learned.
        anchor_rate: f64 = nodes().anchor_rate; FACTOR, "ours";
    }
}

const FACTOR: Bounds = Number { least: 0.0, most: 1e3 };

/// Where the nodes' defaults come from.
fn nodes() -> NodesFieldConfig {
    NodesFieldConfig::new()
}

/// Where the network's defaults come from.
fn network() -> light4gs_model::DeformationConfig {
    light4gs_model::DeformationConfig::new(0)
}

impl ModelConfig {
    /// The Burn configuration that this stands for.
    pub fn build(&self) -> DynamicSceneConfig {
        self.scene(self.field())
    }

    /// The same with another deformation field.
    pub fn scene<F: DeformationField>(&self, field: F::Config) -> DynamicSceneConfig<F> {
        let gaussians = GaussiansConfig::new().with_sh_degree(usize::from(self.sh_degree));
        let CoordinatesTable { pca, contraction } = self.coordinates;
        DynamicSceneConfig::new(gaussians, field)
            .with_coordinates(light4gs_model::CoordinatesConfig { pca, contraction })
            .with_differentiate_points(self.deformation.differentiate_points)
    }

    /// The built-in deformation field that is chosen, with its keys.
    pub fn field(&self) -> BuiltInFieldConfig {
        match self.field {
            FieldKind::HexPlane => BuiltInFieldConfig::HexPlane(self.hexplane_field()),
            FieldKind::Nodes => BuiltInFieldConfig::Nodes(self.nodes_field()),
            FieldKind::Still => BuiltInFieldConfig::Still(()),
        }
    }

    /// The keys of control nodes.
    fn nodes_field(&self) -> NodesFieldConfig {
        let table = &self.nodes;
        NodesFieldConfig {
            nodes: table.count,
            times_a_knot: table.times_a_knot,
            radius: table.radius,
            opacity: table.opacity,
            stillness: table.stillness.then_some(table.stillness_start),
            lifetime: table.lifetime,
            affinities: table.affinities,
            rigidity: table.rigidity,
            smoothness: table.smoothness,
            translation_rate: table.translation_rate,
            rotation_rate: table.rotation_rate,
            anchor_rate: table.anchor_rate,
        }
    }

    /// The keys of the paper's field.
    pub(super) fn hexplane_field(&self) -> HexPlaneFieldConfig {
        let HexPlaneTable { channels, resolution, multipliers } = self.hexplane.clone();
        let network = &self.deformation;
        let hexplane = light4gs_model::HexPlaneConfig::new()
            .with_channels(channels)
            .with_resolution(resolution)
            .with_multipliers(multipliers);
        let deformation =
            light4gs_model::DeformationConfig::new(channels.saturating_mul(self.hexplane.multipliers.len()))
                .with_width(network.width)
                .with_depth(network.depth)
                .with_position(network.position)
                .with_scale(network.scale)
                .with_rotation(network.rotation)
                .with_opacity(network.opacity)
                .with_sh(network.sh);
        HexPlaneFieldConfig::new(hexplane, deformation)
    }
}
