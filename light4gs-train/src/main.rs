//! The binary `light4gs`.

fn main() -> std::process::ExitCode {
    light4gs_train::cli::main()
}
