//! The `precut` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    precut::cli::main(std::env::args_os(), precut::registry::Registry::standard)
}
