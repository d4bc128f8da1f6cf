//! Compiles kernels with naga, wgpu's own compiler, for Vulkan, Metal and Direct3D.
//! usage: light4gs-shader-targets FOLDER, which the test `launches_of_golden_scenes` has written.

use std::error::Error;
use std::process::ExitCode;

use naga::back::{hlsl, msl, spv};
use naga::valid::{Capabilities, ModuleInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator};
use naga::{Module, ShaderStage};

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: light4gs-shader-targets FOLDER")?;
    let file = std::fs::read_to_string(format!("{folder}/launches.json"))?;
    let all: serde_json::Value = serde_json::from_str(&file)?;
    let kernels = all["kernels"].as_array().ok_or("launches.json has no kernels")?;
    let mut failures = 0;
    for kernel in kernels {
        let (name, text) = (kernel["name"].as_str().unwrap_or_default(), kernel["text"].as_str().unwrap_or_default());
        if let Err(error) = targets(text) {
            failures += 1;
            eprintln!("FAILED: {name}\n{error}");
        }
    }
    println!("{} kernels compiled to SPIR-V, MSL and HLSL", kernels.len() - failures);
    Ok(if failures > 0 || kernels.is_empty() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Compiles a kernel for every target.
fn targets(text: &str) -> Result<(), Box<dyn Error>> {
    let module = naga::front::wgsl::parse_str(text).map_err(|error| error.emit_to_string(text))?;
    // The capabilities of a WebGPU adapter with subgroups, and nothing else.
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::SUBGROUP);
    validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
    let info = validator.validate(&module).map_err(|error| error.emit_to_string(text))?;
    to_spirv(&module, &info)?;
    to_msl(&module, &info)?;
    to_hlsl(&module, &info)
}

fn to_spirv(module: &Module, info: &ModuleInfo) -> Result<(), Box<dyn Error>> {
    // Subgroup operations came with Vulkan 1.1 and SPIR-V 1.3.
    let options = spv::Options { lang_version: (1, 3), ..spv::Options::default() };
    let entry = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: "main".to_owned() };
    let words = spv::write_vec(module, info, &options, Some(&entry)).map_err(|error| format!("SPIR-V: {error}"))?;
    if words.is_empty() { Err("SPIR-V: nothing was written".into()) } else { Ok(()) }
}

fn to_msl(module: &Module, info: &ModuleInfo) -> Result<(), Box<dyn Error>> {
    // Metal 2.1 is the version of the oldest Macs on which wgpu offers subgroups.
    let options = msl::Options { lang_version: (2, 1), ..msl::Options::default() };
    let (_, translation) = msl::write_string(module, info, &options, &msl::PipelineOptions::default())
        .map_err(|error| format!("MSL: {error}"))?;
    entry_points_written("MSL", translation.entry_point_names)
}

fn to_hlsl(module: &Module, info: &ModuleInfo) -> Result<(), Box<dyn Error>> {
    // Wave operations came with shader model 6.0.
    let options = hlsl::Options { shader_model: hlsl::ShaderModel::V6_0, ..hlsl::Options::default() };
    let entry = hlsl::PipelineOptions::default();
    let mut text = String::new();
    let reflection = hlsl::Writer::new(&mut text, &options, &entry)
        .write(module, info, None)
        .map_err(|error| format!("HLSL: {error}"))?;
    entry_points_written("HLSL", reflection.entry_point_names)
}

fn entry_points_written<E: std::fmt::Display>(
    target: &str,
    names: Vec<Result<String, E>>,
) -> Result<(), Box<dyn Error>> {
    for name in names {
        name.map_err(|error| format!("{target}: {error}"))?;
    }
    Ok(())
}
