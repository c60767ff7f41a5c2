//! File systems of a test's own: small ones that can be filled, and read-only views of a directory.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A mounted file system, gone when dropped.
pub struct Disk(PathBuf);

fn mount(arguments: &[&str], at: &Path) -> Option<Disk> {
    let mounted = Command::new("mount").args(arguments).arg(at).output();
    mounted
        .is_ok_and(|output| output.status.success())
        .then(|| Disk(at.to_owned()))
}

impl Disk {
    /// A small empty one; `None` where this process may not mount one.
    pub fn small(at: &Path, megabytes: usize) -> Option<Self> {
        let size = format!("size={megabytes}m");
        mount(&["-t", "tmpfs", "-o", &size, "tmpfs"], at)
    }

    /// A directory seen a second time, read-only; `None` where this process may not mount it.
    pub fn read_only(directory: &Path, at: &Path) -> Option<Self> {
        let disk = mount(&["--bind", directory.to_str()?], at)?;
        let remounted = Command::new("mount")
            .args(["-o", "remount,bind,ro"])
            .arg(at)
            .output();
        remounted
            .is_ok_and(|output| output.status.success())
            .then_some(disk)
    }

    /// Takes all the space there is but about this much, in a file.
    pub fn fill(&self, but: usize) {
        let block = vec![0x5a_u8; 4 << 10];
        let mut file = std::fs::File::create(self.0.join("ballast")).unwrap();
        let mut length = 0;
        while let Ok(written) = file.write(&block) {
            length += written;
        }
        file.set_len(length.saturating_sub(but) as u64).unwrap();
    }

    /// Gives the space back.
    pub fn free(&self) {
        std::fs::remove_file(self.0.join("ballast")).unwrap();
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).output();
    }
}
