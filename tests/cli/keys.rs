//! API keys, as an operator makes and uses them.

use crate::service::Service;
use crate::{answer, last_json, run, shapelex, stderr};

#[test]
fn a_key_is_made_used_listed_and_revoked() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let none = run(path, &["keys", "list", "--data", "d"]);
    assert_eq!(none.status.code(), Some(2), "there is no data directory yet");
    let admin = answer(
        path,
        &["keys", "create", "root", "--scope", "admin", "--data", "d"],
    );
    let admin = admin.trim();
    assert!(admin.starts_with("slx_") && admin.len() == 47, "{admin}");
    let again = run(
        path,
        &["keys", "create", "root", "--scope", "read", "--data", "d"],
    );
    assert_eq!(again.status.code(), Some(1));
    assert!(
        stderr(&again).contains("named 'root' already"),
        "{}",
        stderr(&again)
    );

    let service = Service::start(path, &["--data", "d"]);
    assert_eq!(answer(path, &["health", "--server", &service.url]), "alive\n");
    let refused = run(path, &["keys", "list", "--server", &service.url]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("API key"), "{}", stderr(&refused));
    let with = |secret: &str, args: &[&str]| {
        shapelex(path)
            .args(args)
            .args(["--server", &service.url, "--json"])
            .env("SHAPELEX_API_KEY", secret)
            .output()
            .unwrap()
    };
    let made = with(
        admin,
        &["keys", "create", "ci", "--scope", "read", "--expires", "1d"],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    let made = last_json(&String::from_utf8(made.stdout).unwrap());
    assert!(made["expires_at"].is_string(), "{made}");
    let reader = made["secret"].as_str().unwrap();
    assert_eq!(
        with(reader, &["keys", "list"]).status.code(),
        Some(1),
        "a reader sees no keys"
    );
    let revoked = with(admin, &["keys", "revoke", "ci"]);
    assert!(revoked.status.success(), "{}", stderr(&revoked));
    assert!(service.terminate().success());

    let listed = answer(path, &["keys", "list", "--data", "d"]);
    assert!(listed.contains("root") && !listed.contains("ci "), "{listed}");
    let log = std::fs::read_to_string(path.join("d/audit.log")).unwrap();
    assert!(log.contains("\"revoke_key\"") && !log.contains("slx_"), "{log}");
}

#[test]
fn beyond_loopback_a_service_without_keys_does_not_start() {
    let dir = tempfile::tempdir().unwrap();
    let refused = run(dir.path(), &["serve", "--listen", "0.0.0.0:0", "--data", "d"]);
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    let line = said.lines().last().unwrap();
    assert!(
        line.contains("shapelex keys create") && line.contains("--allow-anonymous"),
        "{said}"
    );
}
