//! Launching a WGSL kernel through CubeCL, with errors that name it.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex};

use burn_wgpu::{KernelSource, SourceKernel, SourceTemplate};
use cubecl::client::Client;
use cubecl::device::DeviceId;
use cubecl::ir::attributes::BufferIOAttr;
use cubecl::prelude::{CubeCount, CubeDim, ExecutionMode, KernelId};
use cubecl::server::{Handle, KernelArguments, MetadataBindingInfo};
use light4gs_codec::rendering::{DILATION, MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE, NEAR, TILE};
use light4gs_shaders::Shader;

use crate::cpu::project::INVALID_RADIUS;
use crate::gpu_error::GpuError;

/// Default number of invocations of a workgroup.
pub(super) const WORKGROUP: u32 = 64;
/// Workgroups along one dimension of a dispatch: below WebGPU's limit of 65535.
const MAX_GROUPS: u32 = 32768;
/// Storage buffers that WebGPU guarantees to a kernel.
const MAX_BUFFERS: usize = 8;

type Constants = Vec<(&'static str, u32)>;

/// A shader with the values of its constants.
#[derive(Clone, Debug)]
struct Kernel {
    shader: Shader,
    team: &'static [&'static str],
    workgroup: u32,
    constants: Constants,
}

/// The constants of rendering for WGSL. They are printed as float64, so that a compiler reads exactly the same float32.
fn rendering_constants() -> String {
    let numbers = [
        ("NEAR", NEAR),
        ("DILATION", DILATION),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MAX_ALPHA", MAX_ALPHA),
        ("MIN_TRANSMITTANCE", MIN_TRANSMITTANCE),
    ];
    let numbers = numbers.map(|(name, value)| format!("const {name}: f32 = {:?};\n", f64::from(value)));
    numbers.concat() + &format!("const TILE: u32 = {TILE}u;\nconst INVALID_RADIUS: i32 = {INVALID_RADIUS};\n")
}

impl KernelSource for Kernel {
    fn source(&self) -> SourceTemplate {
        let own = self.constants.iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
        let includes = self.shader.includes.iter().chain(self.team).copied();
        SourceTemplate::new(
            rendering_constants() + &own.collect::<String>() + &includes.collect::<String>() + self.shader.source,
        )
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

/// One launch, built step by step. Buffers are bound in the order given, the uniform after them.
pub(super) struct Launch<'a> {
    client: &'a Client,
    kernel: Kernel,
    arguments: KernelArguments,
    written: Vec<Handle>,
}

/// A kernel on a device.
type Launched = (DeviceId, &'static str, Constants);

/// Kernels that have been launched before.
static LAUNCHED: LazyLock<Mutex<HashSet<Launched>>> = LazyLock::new(Mutex::default);

impl<'a> Launch<'a> {
    pub(super) fn new(client: &'a Client, shader: Shader) -> Self {
        let kernel = Kernel { shader, team: &[], workgroup: WORKGROUP, constants: vec![("WORKGROUP", WORKGROUP)] };
        Self { client, kernel, arguments: KernelArguments::new(), written: Vec::new() }
    }

    /// Sets the size of the workgroup.
    pub(super) fn workgroup(mut self, workgroup: u32) -> Self {
        self.kernel.workgroup = workgroup;
        self.kernel.constants[0].1 = workgroup;
        self
    }

    /// Makes the workgroup a team of that size, whose members communicate as the included files say.
    pub(super) fn team(mut self, team: u32, includes: &'static [&'static str]) -> Self {
        self.kernel.team = includes;
        self.workgroup(team).constant("TEAM", team)
    }

    pub(super) fn constant(mut self, name: &'static str, value: u32) -> Self {
        self.kernel.constants.push((name, value));
        self
    }

    pub(super) fn reads(mut self, buffer: &Handle) -> Self {
        self.arguments = self.arguments.with_buffer_io(buffer.clone().binding(), BufferIOAttr::ReadOnly);
        self
    }

    pub(super) fn writes(mut self, buffer: &Handle) -> Self {
        self.arguments = self.arguments.with_buffer_io(buffer.clone().binding(), BufferIOAttr::WriteOnly);
        self.written.push(buffer.clone());
        self
    }

    pub(super) fn updates(mut self, buffer: &Handle) -> Self {
        self.arguments = self.arguments.with_buffer_io(buffer.clone().binding(), BufferIOAttr::ReadWrite);
        self.written.push(buffer.clone());
        self
    }

    /// A buffer that is read only if `earlier` launches have filled it.
    pub(super) fn updates_if(self, earlier: bool, buffer: &Handle) -> Self {
        if earlier { self.updates(buffer) } else { self.writes(buffer) }
    }

    /// Words of the uniform that follows the buffers.
    pub(super) fn uniform(mut self, words: &[u32]) -> Self {
        // A uniform's size is a multiple of 16 bytes.
        let mut words = words.to_vec();
        words.resize(words.len().next_multiple_of(4), 0);
        let pairs = words.as_chunks::<2>().0;
        let info = pairs.iter().map(|[low, high]| u64::from(*low) | u64::from(*high) << 32).collect();
        self.arguments = self.arguments.with_info(MetadataBindingInfo::custom(info));
        self
    }

    /// Enough workgroups for this many invocations.
    pub(super) fn invocations(self, count: usize) -> Result<(), GpuError> {
        let groups = count.div_ceil(self.kernel.workgroup as usize);
        self.groups(groups)
    }

    /// Launches at least this many workgroups; kernels must ignore those that are too many.
    ///
    /// The first launch of a kernel on a device waits until it is compiled, and returns an error if that failed.
    pub(super) fn groups(self, groups: usize) -> Result<(), GpuError> {
        debug_assert!(self.arguments.resources.len() <= MAX_BUFFERS, "{}: too many buffers", self.kernel.shader.name);
        if groups == 0 {
            return Ok(());
        }
        let groups = groups as u32;
        let count = if groups <= MAX_GROUPS {
            CubeCount::Static(groups, 1, 1)
        } else {
            CubeCount::Static(MAX_GROUPS, groups.div_ceil(MAX_GROUPS), 1)
        };
        let name = self.kernel.shader.name;
        let key = (self.client.service_id().device, name, self.kernel.constants.clone());
        let cube_dim = CubeDim::new_1d(self.kernel.workgroup);
        self.client.launch(Box::new(SourceKernel::new(self.kernel, cube_dim)), count, self.arguments);

        let mut launched = LAUNCHED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if !launched.contains(&key) {
            self.client.check(&self.written).map_err(|error| GpuError::Kernel {
                kernel: name,
                adapter: self.client.name().to_owned(),
                reason: first_lines(&error.to_string()),
            })?;
            launched.insert(key);
        }
        Ok(())
    }
}

/// The part of a driver's message that is useful to a reader, without the backtrace.
pub(super) fn first_lines(message: &str) -> String {
    let end = message.find("Backtrace").or_else(|| message.find("BACKTRACE")).unwrap_or(message.len());
    message[..end].split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::super::context::tests::gpu;
    use super::*;

    const BROKEN: Shader = Shader {
        name: "broken",
        includes: &[],
        source: "@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
                 @compute @workgroup_size(WORKGROUP) fn main() { out[0] = not_a_function(1.0); }",
    };

    #[test]
    fn a_kernel_that_does_not_compile_is_an_error_with_its_name() {
        let client = gpu().client;
        for _ in 0..2 {
            let out = client.empty(256);
            let error = Launch::new(&client, BROKEN).writes(&out).groups(1).unwrap_err();
            let text = error.to_string();
            assert!(matches!(error, GpuError::Kernel { kernel: "broken", .. }), "{text}");
            assert!(text.contains("not_a_function") && text.contains("--device flex"), "{text}");
            assert!(client.read_one(out).is_err(), "the buffer reads as if it had been written");
        }
    }

    #[test]
    fn a_kernel_that_asks_too_much_is_an_error() {
        const GREEDY: Shader = Shader {
            name: "greedy",
            includes: &[],
            source: "@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
                     @compute @workgroup_size(WORKGROUP) fn main() { out[0] = 1.0; }",
        };
        let client = gpu().client;
        let out = client.empty(256);
        let error = Launch::new(&client, GREEDY).workgroup(1 << 20).writes(&out).groups(1).unwrap_err();
        assert!(matches!(error, GpuError::Kernel { kernel: "greedy", .. }), "{error}");
    }
}
