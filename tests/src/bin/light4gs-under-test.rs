//! The program as the command-line tests run it: cargo builds a package's own binaries for its tests, not its
//! dependencies' ones.

fn main() -> std::process::ExitCode {
    light4gs_train::cli::main()
}
