//! The binary `light4gs`.

fn main() -> std::process::ExitCode {
    #[cfg(unix)]
    light4gs::cli::hand_over::to_program_with_gpu();
    // SAFETY: no other thread runs yet.
    unsafe { light4gs_train::memory::keep_freed_memory() };
    light4gs::cli::main()
}
