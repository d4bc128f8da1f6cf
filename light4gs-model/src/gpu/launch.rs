//! Launching a WGSL kernel through CubeCL, with errors that name it.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex};

use burn_wgpu::SourceKernel;
use cubecl::client::Client;
use cubecl::device::DeviceId;
use cubecl::ir::attributes::BufferIOAttr;
use cubecl::prelude::{CubeCount, CubeDim};
use cubecl::server::{Handle, KernelArguments, MetadataBindingInfo};

use super::counting;
use super::kernel::{Constants, Kernel};
use super::recording::{self, RecordedBuffer, RecordedLaunch};
use crate::gpu_error::{GpuError, first_lines};

/// Workgroups along one dimension of a dispatch: below WebGPU's limit of 65535.
const MAX_GROUPS: u32 = 32768;
/// Storage buffers that WebGPU guarantees to a kernel.
const MAX_BUFFERS: usize = 8;

/// One launch, built step by step. Buffers are bound in the order given, the uniform after them.
pub(crate) struct Launch<'a> {
    client: &'a Client,
    kernel: Kernel,
    buffers: Vec<(Handle, BufferIOAttr)>,
    uniform: Vec<u32>,
}

/// A kernel on a device.
type Launched = (DeviceId, &'static str, Constants);

/// Kernels that have been launched before.
static LAUNCHED: LazyLock<Mutex<HashSet<Launched>>> = LazyLock::new(Mutex::default);

impl<'a> Launch<'a> {
    pub(crate) fn new(client: &'a Client, kernel: impl Into<Kernel>) -> Self {
        Self { client, kernel: kernel.into(), buffers: Vec::new(), uniform: Vec::new() }
    }

    pub(crate) fn reads(self, buffer: &Handle) -> Self {
        self.binds(buffer, BufferIOAttr::ReadOnly)
    }

    pub(crate) fn writes(self, buffer: &Handle) -> Self {
        self.binds(buffer, BufferIOAttr::WriteOnly)
    }

    pub(crate) fn updates(self, buffer: &Handle) -> Self {
        self.binds(buffer, BufferIOAttr::ReadWrite)
    }

    /// A buffer that is read only if `earlier` launches have filled it.
    pub(crate) fn updates_if(self, earlier: bool, buffer: &Handle) -> Self {
        if earlier { self.updates(buffer) } else { self.writes(buffer) }
    }

    fn binds(mut self, buffer: &Handle, access: BufferIOAttr) -> Self {
        self.buffers.push((buffer.clone(), access));
        self
    }

    /// Words of the uniform that follows the buffers.
    pub(crate) fn uniform(mut self, words: &[u32]) -> Self {
        // A uniform's size is a multiple of 16 bytes.
        self.uniform = words.to_vec();
        self.uniform.resize(words.len().next_multiple_of(4), 0);
        self
    }

    /// Launches workgroups for `count` invocations.
    pub(crate) fn invocations(self, count: usize) -> Result<(), GpuError> {
        let groups = count.div_ceil(self.kernel.workgroup as usize);
        self.groups(groups)
    }

    /// Launches `groups` workgroups, or some more; a kernel must ignore those in excess.
    ///
    /// The first launch of a kernel on a device waits until it is compiled, and returns an error if that failed.
    pub(crate) fn groups(self, groups: usize) -> Result<(), GpuError> {
        debug_assert!(self.buffers.len() <= MAX_BUFFERS, "{}: too many buffers", self.kernel);
        if groups == 0 {
            return Ok(());
        }
        let groups = match groups as u32 {
            few if few <= MAX_GROUPS => [few, 1],
            many => [MAX_GROUPS, many.div_ceil(MAX_GROUPS)],
        };
        if !recording::is_on() {
            return self.dispatch(groups);
        }
        if self.buffers.iter().enumerate().any(|(k, (a, _))| self.buffers[..k].iter().any(|(b, _)| overlap(a, b))) {
            return Err(self.failed(&"a buffer is bound twice, which browsers refuse"));
        }
        let before = self.contents(|_| true)?;
        self.dispatch(groups)?;
        let after = self.contents(|access| !matches!(access, BufferIOAttr::ReadOnly))?;
        let buffers = before.into_iter().zip(after);
        let buffers =
            buffers.map(|(before, after)| RecordedBuffer { before: before.unwrap_or_default(), after }).collect();
        recording::add(RecordedLaunch { kernel: self.kernel, groups, buffers, uniform: self.uniform });
        Ok(())
    }

    fn dispatch(&self, groups: [u32; 2]) -> Result<(), GpuError> {
        let mut arguments = KernelArguments::new();
        for (buffer, access) in &self.buffers {
            arguments = arguments.with_buffer_io(buffer.clone().binding(), *access);
        }
        if !self.uniform.is_empty() {
            let pairs = self.uniform.as_chunks::<2>().0;
            let info = pairs.iter().map(|[low, high]| u64::from(*low) | u64::from(*high) << 32).collect();
            arguments = arguments.with_info(MetadataBindingInfo::custom(info));
        }
        let name = self.kernel.name();
        let key = (self.client.service_id().device, name, self.kernel.constants.clone());
        let cube_dim = CubeDim::new_1d(self.kernel.workgroup);
        let kernel = SourceKernel::new(self.kernel.clone(), cube_dim);
        counting::launching(name);
        self.client.launch(Box::new(kernel), CubeCount::Static(groups[0], groups[1], 1), arguments);

        let mut launched = LAUNCHED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if !launched.contains(&key) {
            let written = self.buffers.iter().filter(|(_, access)| !matches!(access, BufferIOAttr::ReadOnly));
            self.client.check(written.map(|(buffer, _)| buffer)).map_err(|error| self.failed(&error))?;
            launched.insert(key);
        }
        Ok(())
    }

    /// The bytes of the buffers that are accessed in this way, `None` for the others.
    fn contents(&self, which: impl Fn(BufferIOAttr) -> bool) -> Result<Vec<Option<Vec<u8>>>, GpuError> {
        let read = |(buffer, access): &(Handle, BufferIOAttr)| {
            let bytes = which(*access).then(|| self.client.read_one(buffer.clone())).transpose();
            bytes.map(|bytes| bytes.map(|bytes| bytes.to_vec())).map_err(|error| self.failed(&error))
        };
        self.buffers.iter().map(read).collect()
    }

    fn failed(&self, error: &impl std::fmt::Display) -> GpuError {
        GpuError::Kernel {
            kernel: self.kernel.name(),
            adapter: self.client.name().to_owned(),
            reason: first_lines(&error.to_string()),
        }
    }
}

/// Whether two buffers share memory. Browsers refuse a launch that binds such a pair, even where it only reads.
fn overlap(a: &Handle, b: &Handle) -> bool {
    let range = |handle: &Handle| {
        let start = handle.offset_start.unwrap_or(0);
        start..start + handle.size_in_used()
    };
    let (of_a, of_b) = (range(a), range(b));
    same_memory(a, b) && of_a.start < of_b.end && of_b.start < of_a.end
}

/// Whether two handles are pieces of one buffer.
pub(super) fn same_memory(a: &Handle, b: &Handle) -> bool {
    std::ptr::eq(a.memory.descriptor(), b.memory.descriptor())
}

#[cfg(test)]
mod tests {
    use light4gs_shaders::Shader;

    use super::super::context::tests::default_gpu;
    use super::*;

    const BROKEN: Shader = Shader {
        name: "broken",
        includes: &[],
        source: "@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
                 @compute @workgroup_size(WORKGROUP) fn main() { out[0] = not_a_function(1.0); }",
    };

    #[test]
    fn a_kernel_that_does_not_compile_is_an_error_with_its_name() {
        let client = default_gpu().client;
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
        let client = default_gpu().client;
        let out = client.empty(256);
        let error = Launch::new(&client, Kernel::new(GREEDY).workgroup(1 << 20)).writes(&out).groups(1).unwrap_err();
        assert!(matches!(error, GpuError::Kernel { kernel: "greedy", .. }), "{error}");
    }
}
