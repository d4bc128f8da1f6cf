//! The binary `light4gs`.

fn main() -> std::process::ExitCode {
    // SAFETY: no other thread runs yet.
    unsafe { light4gs_train::memory::keep_freed_memory() };
    light4gs::cli::main()
}
