//! The largest resident memory of this process, as Linux counts it.

/// Begins a new maximum. Does nothing where the system has no such counter.
pub fn reset_peak() {
    // "5" resets the peak resident set size (proc_pid_clear_refs(5)); elsewhere the file does not exist.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The maximum since [`reset_peak`], in bytes; `None` where the system does not tell.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
