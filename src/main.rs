//! The `shapelex` command. Everything it does is in the library's `cli` module.

/// The system's allocator keeps what was freed: after an attack with a budget of 2048 MiB a process under glibc stayed at
/// 1000 to 1200 MB (680 with two arenas), with this one at 190 to 280. docs/operations.md has the comparison.
#[cfg(not(target_env = "msvc"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

fn main() -> std::process::ExitCode {
    shapelex::cli::run(std::env::args_os())
}
