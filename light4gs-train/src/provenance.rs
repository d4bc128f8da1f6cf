//! Where a figure comes from: the commit of this program, and this machine. Neither says who uses it.

use std::fs;
use std::thread::available_parallelism;

/// The commit from which this program was built, with the suffix `-dirty` if files had been changed; `unknown` outside of the
/// repository.
pub const COMMIT: &str = env!("LIGHT4GS_COMMIT");

/// Processor and cores of this machine, such as `AMD EPYC 7763 64-Core Processor, 2 cores`; the architecture where the system does not
/// tell the processor's name.
pub fn machine() -> String {
    let cores = available_parallelism().map_or(1, usize::from);
    let known = fs::read_to_string("/proc/cpuinfo").ok();
    let processor = known.as_deref().and_then(processor_name).unwrap_or(std::env::consts::ARCH);
    format!("{processor}, {cores} core{}", if cores == 1 { "" } else { "s" })
}

/// The name of the first processor in Linux' `/proc/cpuinfo`, which not every architecture has.
fn processor_name(cpuinfo: &str) -> Option<&str> {
    let named = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.trim_start().strip_prefix(':'));
    named.map(str::trim).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_has_its_name() {
        let x86 = "processor\t: 0\nmodel\t\t: 1\nmodel name\t: AMD EPYC 7763 64-Core Processor\nmodel name\t: other\n";
        assert_eq!(processor_name(x86), Some("AMD EPYC 7763 64-Core Processor"));
        assert_eq!(processor_name("processor\t: 0\nBogoMIPS\t: 50.00\n"), None);
        assert_eq!(processor_name("model name\t:\n"), None);
        assert!(machine().contains("core"), "{}", machine());
    }
}
