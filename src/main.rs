//! The `shapelex` command. Everything it does is in the library's `cli` module.

fn main() -> std::process::ExitCode {
    shapelex::cli::run(std::env::args_os())
}
