//! The binary `light4gs`.

fn main() -> std::process::ExitCode {
    #[cfg(unix)]
    light4gs::cli::hand_over::to_program_with_gpu();
    // SAFETY: no other thread runs yet.
    unsafe {
        light4gs_train::memory::keep_freed_memory();
        // Without it, a graphics driver in software prints an error for each way to a window, of which none is needed.
        if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
            std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir());
        }
    }
    light4gs::cli::Program::default().main()
}
