//! The `shapelex` command. Everything it does is in the library's `cli` module.

/// The system's allocator keeps what was freed, so that the process outgrows its budget for memory. This one gives it back
/// after a tenth of a second, at the same cost of a query; docs/operations.md has the comparison.
#[cfg(not(target_env = "msvc"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// What jemalloc reads at its start. By itself it keeps freed pages for 10 s, in which a few large requests after each
/// other add up.
#[cfg(not(target_env = "msvc"))]
#[allow(
    unsafe_code,
    reason = "jemalloc takes its settings from a symbol of this name"
)]
// SAFETY: no other symbol has the name; jemalloc reads a pointer to text that ends with a zero, and never writes.
#[unsafe(export_name = "_rjem_malloc_conf")]
pub static ALLOCATOR_SETTINGS: &[u8; 36] = b"dirty_decay_ms:100,muzzy_decay_ms:0\0";

fn main() -> std::process::ExitCode {
    shapelex::cli::run(std::env::args_os())
}
