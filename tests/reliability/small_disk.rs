//! A disk that a test may fill.

use std::path::Path;
use std::process::{Command, Stdio};

/// A small file system; gone with this value.
pub struct SmallDisk {
    folder: tempfile::TempDir,
}

impl SmallDisk {
    /// `None` where nobody may mount one.
    pub fn new(size: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().to_str().unwrap();
        runs("mount", &["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs", place]).then_some(Self { folder })
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Takes all room that is left.
    pub fn fill(&self) {
        let file = self.folder.path().join("ballast");
        let status = Command::new("dd")
            .args(["if=/dev/zero", &format!("of={}", file.display()), "bs=4096", "oflag=append", "conv=notrunc"])
            .stderr(Stdio::null())
            .status()
            .unwrap();
        assert!(!status.success(), "the disk is full");
    }

    pub fn make_room(&self) {
        std::fs::remove_file(self.folder.path().join("ballast")).unwrap();
    }

    #[allow(dead_code)] // not every program of tests does
    pub fn remount(&self, mode: &str) -> bool {
        runs("mount", &["-o", &format!("remount,{mode}"), self.folder.path().to_str().unwrap()])
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        runs("umount", &["-l", self.folder.path().to_str().unwrap()]);
    }
}

/// Runs a command of the system; whether it did what it should.
fn runs(program: &str, arguments: &[&str]) -> bool {
    let command = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    command.is_ok_and(|status| status.success())
}
