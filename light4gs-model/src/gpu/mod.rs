//! Kernels of the wgpu back end: the host side of the WGSL in `shaders/`.
//!
//! Public are the kernels as text ([`kernels`]) and launches as data ([`record`]), so that compilers and adapters other than
//! those of this machine can be tried: `.ci/webgpu` does; and the number of launches ([`LaunchCounter`]).

mod context;
mod counting;
mod elementwise;
mod kernel;
mod launch;
mod nodes;
mod planes;
mod rate;
mod recording;
mod significance;
mod skinning;
mod sort;
mod splat;
mod subgroups;
mod team;
mod training;

pub use counting::{LaunchCounter, LaunchCounts};
pub(crate) use elementwise::{
    activation_backward_on_gpu, activation_on_gpu, lower_bound_backward_on_gpu, normal_cdf_backward_on_gpu,
    normal_cdf_on_gpu, place_columns_on_gpu, uniform_noise_on_gpu,
};
pub use kernel::Kernel;
pub use recording::{RecordedBuffer, RecordedLaunch, record};
pub(crate) use significance::significance_on_gpu;
pub use team::{Communication, Team, with_team};
pub(crate) use training::adam_on_gpu;

/// Every kernel that the program can launch, on any adapter and with any configuration.
pub fn kernels() -> Vec<Kernel> {
    [
        elementwise::kernels,
        nodes::kernels,
        planes::kernels,
        rate::kernels,
        significance::kernels,
        skinning::kernels,
        sort::kernels,
        splat::kernels,
        subgroups::kernels,
        training::kernels,
    ]
    .into_iter()
    .flat_map(|kernels| kernels())
    .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_shader_is_in_the_list_of_kernels_and_no_kernel_twice() {
        let all = kernels();
        for shader in light4gs_shaders::ALL {
            assert!(all.iter().any(|kernel| kernel.name() == shader.name), "{}", shader.name);
        }
        let names: HashSet<String> = all.iter().map(Kernel::to_string).collect();
        assert_eq!(names.len(), all.len());
    }
}
