//! The `precut` command.

fn main() {}
