//! The `precut` command.

use std::process::ExitCode;

/// The system's allocator gives the large arrays of an answer back at once, and every next answer pays for its pages
/// anew: half of the time of an answer at 10,000 stations.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    precut::cli::main(std::env::args_os(), precut::registry::Registry::standard)
}
