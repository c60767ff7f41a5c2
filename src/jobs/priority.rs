//! The threads that learn give way to those that answer.
//!
//! They have a pool of their own with fewer threads than there are cores, but the system shares cores between all
//! threads alike. With a lower priority they take what queries leave, and a small share where these leave nothing, so
//! that neither starves the other.

/// Their niceness: a tenth of a thread's share where others want the core.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 10;

/// Lowers the priority of the calling thread, for good. On Linux priorities are a thread's; elsewhere they are the
/// process's, and nothing is done.
#[cfg(target_os = "linux")]
pub(super) fn give_way() {
    let thread = rustix::thread::gettid();
    let lowered = rustix::process::getpriority_process(Some(thread))
        .and_then(|nice| rustix::process::setpriority_process(Some(thread), nice.saturating_add(NICENESS)));
    if let Err(error) = lowered {
        tracing::warn!(%error, "a learning thread keeps its priority; queries may wait for it");
    }
}

/// See above.
#[cfg(not(target_os = "linux"))]
pub(super) fn give_way() {}
