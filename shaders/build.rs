//! Makes a constant of every file of WGSL here: its text, what it includes, and the beginning of its comment as documentation.
//!
//! So a new kernel is a new file, and no list names it.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Folders of text that kernels share; each is a module of constants. Every other folder holds the kernels of an operation.
const SHARED: [&str; 2] = ["include", "team"];
/// Begins the line of a kernel that names the files of `include/` that come before it, in their order.
const INCLUDES: &str = "// #include ";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=.");
    // The generated file names this folder, and another work tree may share the target folder.
    println!("cargo::rerun-if-env-changed=CARGO_MANIFEST_DIR");
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let (shared, kernels): (Vec<PathBuf>, Vec<PathBuf>) =
        files(&root)?.into_iter().partition(|file| SHARED.contains(&folder(file)));

    let mut code = String::new();
    for module in SHARED {
        let files = shared.iter().filter(|file| folder(file) == module);
        let constants: Result<String, _> = files.map(|file| text(file)).collect();
        code += &format!("/// What stands in `{module}/`.\npub mod {module} {{\n{}}}\n", constants?);
    }
    let mut names = Vec::new();
    for file in &kernels {
        code += &shader(file, &shared)?;
        names.push(constant(file));
    }
    code += &format!("/// All of them.\npub const ALL: &[Shader] = &[{}];\n", names.join(", "));
    fs::write(Path::new(&env::var("OUT_DIR")?).join("shaders.rs"), code)?;
    Ok(())
}

/// The files of WGSL in the folders here, in order.
fn files(root: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut found = Vec::new();
    for folder in fs::read_dir(root)? {
        let folder = folder?.path();
        if folder.is_dir() {
            for file in fs::read_dir(folder)? {
                found.push(file?.path());
            }
        }
    }
    found.retain(|file| file.extension().is_some_and(|extension| extension == "wgsl"));
    found.sort();
    Ok(found)
}

fn folder(file: &Path) -> &str {
    file.parent().and_then(Path::file_name).and_then(|name| name.to_str()).unwrap_or_default()
}

fn name(file: &Path) -> &str {
    file.file_stem().and_then(|name| name.to_str()).unwrap_or_default()
}

fn constant(file: &Path) -> String {
    name(file).to_uppercase()
}

/// The first paragraph of the comment that a file begins with.
fn documentation(source: &str) -> String {
    let lines = source.lines().map_while(|line| line.strip_prefix("// "));
    lines.map(|line| format!("/// {line}\n")).collect()
}

/// A constant with the text of a file.
fn text(file: &Path) -> Result<String, Box<dyn Error>> {
    let documentation = documentation(&fs::read_to_string(file)?);
    Ok(format!("{documentation}pub const {}: &str = include_str!({file:?});\n", constant(file)))
}

/// A constant with a kernel.
fn shader(file: &Path, shared: &[PathBuf]) -> Result<String, Box<dyn Error>> {
    let source = fs::read_to_string(file)?;
    // Every kernel finds its place in a dispatch.
    let mut includes = vec!["include::DISPATCH".to_owned()];
    for included in source.lines().filter_map(|line| line.strip_prefix(INCLUDES)).flat_map(|names| names.split(", ")) {
        let known = shared.iter().any(|file| folder(file) == "include" && name(file) == included);
        if !known {
            return Err(format!("{}: there is no include/{included}.wgsl", file.display()).into());
        }
        includes.push(format!("include::{}", included.to_uppercase()));
    }
    Ok(format!(
        "{}pub const {}: Shader = Shader {{ name: {:?}, includes: &[{}], source: include_str!({file:?}) }};\n",
        documentation(&source),
        constant(file),
        name(file),
        includes.join(", ")
    ))
}
