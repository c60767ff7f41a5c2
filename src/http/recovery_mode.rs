//! When a service starts in recovery mode: it serves the catalogue, and loads, learns and changes nothing.

use super::config::ServiceConfig;
use crate::store::{PREPARED_BYTES, Store};

/// What dictionaries take in memory, per byte on the disk, beside those that are prepared for coding.
const IN_MEMORY: f64 = 1.1;
/// What a dictionary takes more once it is prepared, per byte on the disk.
const PREPARED: f64 = 6.0;

/// Why this start is one in recovery mode; `None` where it is not.
pub(super) fn reason(config: &ServiceConfig, store: &Store) -> Option<String> {
    if config.recovery_mode {
        return Some("it was asked for by recovery_mode".to_owned());
    }
    // A generation that cannot be read is another matter: it is learnt again.
    let generation = store.generation().ok().flatten()?;
    let bytes = generation.classes.iter().map(|class| class.bytes).sum();
    too_large(bytes, available_memory()?)
}

fn too_large(bytes: u64, available: u64) -> Option<String> {
    let prepared = (bytes as f64 * PREPARED).min(PREPARED_BYTES as f64);
    let needed = bytes as f64 * IN_MEMORY + prepared;
    (needed > available as f64).then(|| {
        format!(
            "the index needs about {:.0} MiB of memory and there are {} MiB; give it more, or delete classes elsewhere",
            needed / f64::from(1 << 20),
            available >> 20
        )
    })
}

/// Memory the process may still take, in bytes: the system's, or its control group's where that is less. `None` where
/// the system does not say.
fn available_memory() -> Option<u64> {
    let system = meminfo(&std::fs::read_to_string("/proc/meminfo").ok()?)?;
    let read = |name: &str| std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok();
    let group = control_group(read("memory.max").as_deref(), read("memory.current").as_deref());
    Some(group.map_or(system, |group| system.min(group)))
}

fn meminfo(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes << 10)
}

/// `max` is no number where there is no limit.
fn control_group(limit: Option<&str>, used: Option<&str>) -> Option<u64> {
    let number = |text: Option<&str>| text?.trim().parse::<u64>().ok();
    Some(number(limit)?.saturating_sub(number(used)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_is_read() {
        let text = "MemTotal:       24000000 kB\nMemFree:  100 kB\nMemAvailable:   2048 kB\n";
        assert_eq!(meminfo(text), Some(2 << 20));
        assert_eq!(meminfo("MemTotal: 1 kB"), None);
        assert_eq!(control_group(Some("max\n"), Some("7\n")), None);
        assert_eq!(control_group(Some("100\n"), Some("30\n")), Some(70));
        assert_eq!(control_group(Some("100\n"), Some("130\n")), Some(0));
        assert_eq!(control_group(None, None), None);
    }

    #[test]
    fn an_index_that_does_not_fit_is_named_with_the_numbers() {
        assert_eq!(too_large(100 << 20, 159 << 20), None);
        let why = too_large(100 << 20, 157 << 20).unwrap();
        assert!(why.contains("158 MiB") && why.contains("157 MiB"), "{why}");
        // A small index is prepared as a whole.
        assert!(too_large(1 << 20, 7 << 20).is_some_and(|why| why.contains("7 MiB")));
        assert_eq!(too_large(1 << 20, 8 << 20), None);
    }
}
