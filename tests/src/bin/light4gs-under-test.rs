//! The program for the command-line tests. Cargo builds the binaries of the package under test, but not those of its
//! dependencies, so this package has its own.

fn main() -> std::process::ExitCode {
    light4gs::cli::main()
}
