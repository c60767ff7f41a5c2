//! Uploaded files that are damaged on the disk are found when they are read, named, and healed by uploading them again.

use crate::harness::{Answer, App, small};
use crate::meshes::{CLASSES, off};
use axum::body::Body;
use axum::http::Request;
use serde_json::json;
use shapelex::model::ContentHash;
use shapelex::store::OriginalDamage;
use std::ops::ControlFlow;
use std::path::PathBuf;

async fn upload(app: &App, pose: u32) -> Answer {
    let path = format!("/v1/classes/{}/shapes?create=true&name={pose}.off", CLASSES[0]);
    let answer = app.post(&path, "model/off", off(CLASSES[0], pose)).await;
    assert!([200, 201].contains(&answer.status.as_u16()), "{}", answer.text());
    answer
}

/// The address of an uploaded shape's file, and where it lies.
fn placed(app: &App, answer: &Answer, contents: &[u8]) -> (String, PathBuf) {
    let original = answer.value()["shapes"][0]["original"]
        .as_str()
        .unwrap()
        .to_owned();
    (original, app.state.store.original_path(ContentHash::of(contents)))
}

async fn with_tag(app: &App, path: &str, tag: &str) -> Answer {
    let request = Request::builder().uri(path).header("if-none-match", tag);
    app.send(request.body(Body::empty()).unwrap()).await
}

async fn gauge(app: &App, name: &str) -> f64 {
    let text = app.get("/metrics").await.text();
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} ")));
    line.unwrap_or_else(|| panic!("{name} is missing"))
        .parse()
        .unwrap()
}

/// Damages a file in every way a disk may, one after the other; each keeps or changes the length.
fn damages(contents: &[u8]) -> Vec<(&'static str, Option<Vec<u8>>)> {
    let mut bit = contents.to_vec();
    bit[contents.len() / 2] ^= 1;
    vec![
        ("one bit", Some(bit)),
        ("zero length", Some(Vec::new())),
        ("zeros", Some(vec![0; contents.len()])),
        ("cut", Some(contents[..contents.len() - 1].to_vec())),
        ("longer", Some([contents, b"\n".as_slice()].concat())),
        ("gone", None),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_file_is_never_handed_out_and_an_upload_heals_it() {
    let app = App::new();
    let contents = off(CLASSES[0], 0);
    let (original, path) = placed(&app, &upload(&app, 0).await, &contents);
    let whole = app.get(&original).await;
    assert!(whole.status == 200 && whole.body == contents);
    let tag = whole.header("etag").to_owned();
    assert_eq!(with_tag(&app, &original, &tag).await.status, 304);
    for (what, damaged) in damages(&contents) {
        let code = match &damaged {
            Some(bytes) => {
                std::fs::write(&path, bytes).unwrap();
                "original_damaged"
            }
            None => {
                std::fs::remove_file(&path).unwrap();
                "original_missing"
            }
        };
        let answer = app.get(&original).await;
        let problem = answer.fails(500, code);
        assert_eq!(answer.header("etag"), "", "{what}");
        assert!(
            problem["detail"]
                .as_str()
                .unwrap()
                .contains("upload the same file again"),
            "{what}: {problem}"
        );
        // A copy that is there already does not hide the damage.
        with_tag(&app, &original, &tag).await.fails(500, code);
        let ready = app.get("/readyz").await;
        let integrity = ready.value()["checks"]["integrity"].as_str().unwrap().to_owned();
        assert_eq!(ready.status, 200, "{what}");
        assert!(
            integrity.starts_with("degraded: 1 uploaded files"),
            "{what}: {integrity}"
        );
        assert_eq!(gauge(&app, "shapelex_damaged_originals").await, 1.0, "{what}");

        let again = upload(&app, 0).await;
        assert_eq!(again.status, 200, "{what}: the shape was there already");
        assert!(app.get(&original).await.body == contents, "{what}");
        assert_eq!(
            app.get("/readyz").await.value()["checks"]["integrity"],
            "ok",
            "{what}"
        );
        assert_eq!(gauge(&app, "shapelex_damaged_originals").await, 0.0, "{what}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shape_whose_file_is_damaged_can_be_deleted() {
    let app = App::new();
    let (original, path) = placed(&app, &upload(&app, 0).await, &off(CLASSES[0], 0));
    std::fs::write(&path, b"damaged").unwrap();
    app.get(&original).await.fails(500, "original_damaged");
    let shape = original.strip_suffix("/original").unwrap();
    assert_eq!(app.delete(shape).await.status, 204);
    assert!(!path.exists());
    app.get(&original).await.fails(404, "shape_not_found");
    assert_eq!(app.get("/readyz").await.value()["checks"]["integrity"], "ok");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reindex_names_the_damaged_file() {
    let app = App::indexed().await;
    let path = app
        .state
        .store
        .original_path(ContentHash::of(&off(CLASSES[0], 1)));
    std::fs::write(&path, b"OFF\n").unwrap();
    // Other parameters of the description, so that no cached signatures stand in for the file.
    let mut parameters = small();
    parameters["eigenpairs"] = json!(48);
    let job = app
        .reindex(json!({"scope": "all", "parameters": parameters}))
        .await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let failures = job["result"]["failed_shapes"].as_array().unwrap();
    assert_eq!(failures.len(), 1, "{job}");
    assert_eq!(failures[0]["code"], "original_damaged", "{job}");
    let name = path.file_name().unwrap().to_str().unwrap();
    assert!(failures[0]["detail"].as_str().unwrap().contains(name), "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scrub_finds_damage_nobody_asked_for_and_a_restart_remembers_it() {
    let directory = tempfile::tempdir().unwrap();
    let open = || {
        App::on(
            shapelex::http::AppState::open(shapelex::http::ServiceConfig {
                data_dir: directory.path().to_owned(),
                ..shapelex::http::ServiceConfig::default()
            })
            .unwrap(),
        )
    };
    let app = open();
    let mut paths = Vec::new();
    for pose in 0..4 {
        let answer = upload(&app, pose).await;
        paths.push(placed(&app, &answer, &off(CLASSES[0], pose)).1);
    }
    let scrub = |app: &App| {
        let store = app.state.store.clone();
        store.scrub(&mut |_| ControlFlow::Continue(())).unwrap().unwrap()
    };
    let clean = scrub(&app);
    assert_eq!((clean.originals, clean.damaged_originals.len()), (4, 0));
    assert!(
        clean.records > 10 && clean.damaged_records.is_empty(),
        "{clean:?}"
    );
    std::fs::write(&paths[1], b"").unwrap();
    std::fs::remove_file(&paths[2]).unwrap();
    let found = scrub(&app);
    assert_eq!((found.originals, found.damaged_originals.len()), (4, 2));
    let ready = app.get("/readyz").await.value();
    assert_eq!(ready["last_scrub"]["damaged_originals"], 2, "{ready}");
    assert_eq!(gauge(&app, "shapelex_damaged_originals").await, 2.0);
    assert_eq!(gauge(&app, "shapelex_scrub_originals").await, 4.0);
    assert!(gauge(&app, "shapelex_scrub_timestamp_seconds").await > 1.7e9);
    assert!(gauge(&app, "shapelex_disk_free_bytes").await > 0.0);
    drop(app);

    let app = open();
    assert_eq!(app.state.store.last_scrub().unwrap(), found);
    app.state.store.recheck_damage();
    let kinds: Vec<_> = app.state.store.damage().originals.into_values().collect();
    assert!(
        kinds.contains(&OriginalDamage::Changed) && kinds.contains(&OriginalDamage::Missing),
        "{kinds:?}"
    );
    for pose in 0..4 {
        upload(&app, pose).await;
    }
    assert!(scrub(&app).damaged_originals.is_empty());
    assert!(app.state.store.damage().is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scrub_lives_with_deletions_and_can_be_broken_off() {
    let app = App::new();
    let mut shapes = Vec::new();
    for pose in 0..12 {
        let answer = upload(&app, pose).await.value();
        shapes.push(answer["shapes"][0]["id"].as_str().unwrap().to_owned());
    }
    let store = app.state.store.clone();
    let mut left = shapes.clone();
    let report = store
        .scrub(&mut |_| {
            if let Some(id) = left.pop() {
                store.delete_shape(id.parse().unwrap()).unwrap();
            }
            ControlFlow::Continue(())
        })
        .unwrap()
        .unwrap();
    assert!(
        report.damaged_originals.is_empty() && report.damaged_records.is_empty(),
        "{report:?}"
    );
    assert!(left.is_empty() || report.originals > 0);
    upload(&app, 0).await;
    let before = store.last_scrub();
    assert!(store.scrub(&mut |_| ControlFlow::Break(())).unwrap().is_none());
    assert_eq!(store.last_scrub(), before, "what was broken off is not noted");
}

#[tokio::test(flavor = "multi_thread")]
async fn gauges_count_what_exists() {
    let app = App::indexed().await;
    assert_eq!(gauge(&app, "shapelex_index_classes").await, CLASSES.len() as f64);
    assert_eq!(
        app.delete(&format!("/v1/classes/{}", CLASSES[0])).await.status,
        204
    );
    let left = (CLASSES.len() - 1) as f64;
    assert_eq!(gauge(&app, "shapelex_classes").await, left);
    assert_eq!(gauge(&app, "shapelex_index_classes").await, left);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_service_scrubs_by_itself_and_a_stop_does_not_wait_for_it() {
    use std::time::{Duration, Instant};
    let app = App::with(|config| {
        config.scrub_every = Some(Duration::from_millis(100));
        config.scrub_bytes_per_second = 1 << 30;
    });
    let contents = off(CLASSES[0], 0);
    let (_, path) = placed(&app, &upload(&app, 0).await, &contents);
    std::fs::write(&path, b"damaged").unwrap();
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let shutdown = async move {
        let _ = stopped.await;
    };
    let service = tokio::spawn(shapelex::http::serve(app.state.clone(), listener, shutdown));
    let began = Instant::now();
    while app
        .state
        .store
        .last_scrub()
        .is_none_or(|last| last.damaged_originals.len() != 1)
    {
        assert!(
            began.elapsed() < Duration::from_secs(20),
            "no scrub came by itself"
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(gauge(&app, "shapelex_damaged_originals").await, 1.0);
    stop.send(()).unwrap();
    service.await.unwrap().unwrap();

    // So slow that it would take hours.
    let app = App::with(|config| {
        config.scrub_every = Some(Duration::from_millis(50));
        config.scrub_bytes_per_second = 1;
    });
    upload(&app, 0).await;
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let stopping = tokio::time::sleep(Duration::from_millis(500));
    let began = Instant::now();
    shapelex::http::serve(app.state.clone(), listener, stopping)
        .await
        .unwrap();
    assert!(began.elapsed() < Duration::from_secs(5));
    assert_eq!(app.state.store.last_scrub(), None);
}
