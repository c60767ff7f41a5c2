//! Settings from flags, files and defaults.

use super::*;
use std::io::Write;

fn file(text: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file
}

#[test]
fn an_embedder_gets_the_defaults_of_the_command_line() {
    assert_eq!(Config::default().service(), ServiceConfig::default());
}

#[test]
fn flags_win_over_the_file_and_the_file_over_defaults() {
    let file = file("listen = \"0.0.0.0:80\"\njob_queue = 7\nlog_format = \"json\"\n");
    let flags = Settings {
        job_queue: Some(9),
        ..Settings::default()
    };
    let config = flags
        .or(Settings::from_file(file.path()).unwrap())
        .resolve()
        .unwrap();
    assert_eq!(config.job_queue, 9);
    assert_eq!(config.listen, "0.0.0.0:80".parse().unwrap());
    assert_eq!(config.log_format, LogFormat::Json);
    assert_eq!(config.data, Path::new(DEFAULT_DATA));
}

#[test]
fn a_wrong_file_is_refused_with_the_line_and_the_key() {
    let unknown = file("job_queue = 7\n\nport = 80\n");
    let error = Settings::from_file(unknown.path()).unwrap_err().to_string();
    assert!(error.contains("line 3") && error.contains("port"), "{error}");
    assert!(error.contains("listen"), "names what there is: {error}");
    let kind = file("job_queue = \"many\"\n");
    let error = Settings::from_file(kind.path()).unwrap_err().to_string();
    assert!(
        error.contains("line 1: job_queue: ") && !error.contains('\n'),
        "{error}"
    );
    assert!(Settings::from_file(Path::new("/nowhere/shapelex.toml")).is_err());
}

#[test]
fn zeros_that_would_refuse_everything_are_refused() {
    let settings = Settings {
        max_vertices: Some(0),
        ..Settings::default()
    };
    let error = settings.resolve().unwrap_err().to_string();
    assert_eq!(error, "max_vertices must be 1 or more, got 0");
    let file = file("job_queue = 7\n\nmax_vertices = 0\n");
    let error = Settings::from_file(file.path()).unwrap().resolve().unwrap_err();
    let said = error.in_file(file.path()).to_string();
    assert!(
        said.contains("line 3: max_vertices must be 1 or more, got 0"),
        "{said}"
    );
}
