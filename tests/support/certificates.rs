//! An authority of a test's own, and certificates that it has signed.

use std::path::Path;
use std::process::{Command, Stdio};

/// A key with its certificate; `None`, with a word, where nobody can make one.
pub fn certificate(folder: &Path, name: &str, arguments: &[&str]) -> Option<()> {
    let mut command = Command::new("openssl");
    command.args(["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2"]);
    command.args(["-keyout", &format!("{name}.key"), "-out", &format!("{name}.pem")]).args(arguments);
    match command.current_dir(folder).stdin(Stdio::null()).output() {
        Ok(output) => assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr)),
        Err(error) => {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "openssl: {error}");
            eprintln!("NOT TESTED: openssl: {error}");
            return None;
        }
    }
    Some(())
}

/// What the authority has signed.
pub fn signed(folder: &Path, name: &str, arguments: &[&str]) -> Option<()> {
    let by = ["-CA", "plant.pem", "-CAkey", "plant.key", "-addext", "basicConstraints=critical,CA:FALSE"];
    certificate(folder, name, &[&by, arguments].concat())
}
