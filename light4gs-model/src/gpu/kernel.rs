//! A kernel: a shader with the values of its constants, and the text that a compiler gets.

use std::fmt;

use burn_wgpu::{KernelSource, SourceTemplate};
use cubecl::prelude::{CubeDim, ExecutionMode, KernelId};
use light4gs_codec::rendering::{DILATION, MAX_ALPHA, MAX_LOGARITHM, MIN_ALPHA, MIN_TRANSMITTANCE, NEAR, TILE};
use light4gs_render::INVALID_RADIUS;
use light4gs_shaders::Shader;

use super::team::{Communication, Team};

/// Default number of invocations of a workgroup.
const WORKGROUP: u32 = 64;

pub(super) type Constants = Vec<(&'static str, u32)>;

/// A WGSL kernel of the wgpu back end. It is written as its name and its constants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kernel {
    shader: Shader,
    team: Option<Communication>,
    pub(super) workgroup: u32,
    pub(super) constants: Constants,
}

impl Kernel {
    pub(crate) fn new(shader: Shader) -> Self {
        Self { shader, team: None, workgroup: WORKGROUP, constants: vec![("WORKGROUP", WORKGROUP)] }
    }

    /// Invocations of a workgroup.
    pub(crate) fn invocations(&self) -> usize {
        self.workgroup as usize
    }

    /// Sets the size of the workgroup.
    pub(super) fn workgroup(mut self, workgroup: u32) -> Self {
        self.workgroup = workgroup;
        self.constants[0].1 = workgroup;
        self
    }

    pub(crate) fn constant(mut self, name: &'static str, value: u32) -> Self {
        self.constants.push((name, value));
        self
    }

    /// A kernel that blends: the workgroup is a team.
    pub(crate) fn blending(mut self, team: Team) -> Self {
        self.team = Some(team.communication);
        self.workgroup(team.members).constant("TEAM", team.members).constant("CELL", team.cell)
    }

    /// The file in `shaders/`, without its ending.
    pub fn name(&self) -> &'static str {
        self.shader.name
    }

    /// The WGSL: constants, then includes, then the kernel itself, whose entry point is `main`.
    ///
    /// The text of a kernel with subgroup operations lacks the directive `enable subgroups;`, which browsers want before it:
    /// wgpu's own compiler does not know the directive, and takes these operations without it.
    pub fn text(&self) -> String {
        let own = self.constants.iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
        let includes = self.shader.includes.iter().chain(self.team.map_or(&[][..], Communication::includes)).copied();
        rendering_constants() + &own.collect::<String>() + &includes.collect::<String>() + self.shader.source
    }
}

impl From<Shader> for Kernel {
    fn from(shader: Shader) -> Self {
        Self::new(shader)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.shader.name)?;
        for (name, value) in &self.constants {
            write!(f, " {name}={value}")?;
        }
        self.team.map_or(Ok(()), |team| write!(f, " {team:?}"))
    }
}

/// The constants of rendering for WGSL. They are printed as float64, so that a compiler reads exactly the same float32.
fn rendering_constants() -> String {
    let numbers = [
        ("NEAR", NEAR),
        ("DILATION", DILATION),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MAX_ALPHA", MAX_ALPHA),
        ("MIN_TRANSMITTANCE", MIN_TRANSMITTANCE),
        ("MAX_LOGARITHM", MAX_LOGARITHM),
    ];
    let numbers = numbers.map(|(name, value)| format!("const {name}: f32 = {:?};\n", f64::from(value)));
    let near = NEAR.to_bits();
    numbers.concat()
        + &format!(
            "const NEAR_BITS: u32 = {near}u;\nconst TILE: u32 = {TILE}u;\nconst INVALID_RADIUS: i32 = {INVALID_RADIUS};\n"
        )
}

impl KernelSource for Kernel {
    fn source(&self) -> SourceTemplate {
        SourceTemplate::new(self.text())
    }

    fn id(&self) -> KernelId {
        KernelId::new::<Self>()
            .info((self.shader.name, self.team, self.constants.clone()))
            .cube_dim(*CubeDim::new_1d(self.workgroup))
            .mode(ExecutionMode::Unchecked)
    }

    fn lang(&self) -> &'static str {
        "wgsl"
    }
}
