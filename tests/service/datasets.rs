//! A whole dataset as one archive.

use crate::harness::{App, multipart};
use crate::meshes::{mesh, off};
use crate::uploads::{gzip, tar_of, zip_of};
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};

async fn upload(app: &App, files: &[(&str, &[u8])]) -> crate::harness::Answer {
    app.post("/v1/shapes", "application/zip", zip_of(files)).await
}

async fn class_names(app: &App) -> Vec<String> {
    let classes = app.get("/v1/classes").await.value();
    let items = classes["items"].as_array().unwrap().iter();
    let mut names: Vec<String> = items
        .map(|class| class["name"].as_str().unwrap().to_owned())
        .collect();
    names.sort();
    names
}

fn shapes_of(class: &Value) -> Vec<&str> {
    let shapes = class["shapes"].as_array().unwrap().iter();
    shapes.map(|shape| shape["name"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn top_folders_are_classes_in_every_kind_of_archive() {
    let (a, b, c) = (off("bean", 0), mesh("bean", 1).obj(), off("star", 0));
    let files: &[(&str, &[u8])] = &[
        ("bean/a.off", &a),
        ("star/old/deep/c.off", &c),
        ("bean/b.obj", &b),
        ("bean/b.mtl", b"newmtl x"),
        ("notes.txt", b"outside folders, but no mesh"),
        ("__MACOSX/bean/._a.off", b"x"),
    ];
    let inner: Vec<(String, &[u8])> = files
        .iter()
        .map(|(path, bytes)| (format!("set/{path}"), *bytes))
        .collect();
    let inner: Vec<(&str, &[u8])> = inner
        .iter()
        .map(|(path, bytes)| (path.as_str(), *bytes))
        .collect();
    for (media_type, body) in [
        ("application/zip", zip_of(files)),
        ("application/octet-stream", zip_of(&inner)),
        ("application/x-tar", tar_of(files)),
        ("application/gzip", gzip(&tar_of(&inner))),
    ] {
        let app = App::new();
        let answer = app.post("/v1/shapes", media_type, body).await;
        assert_eq!(answer.status, 201, "{media_type}: {}", answer.text());
        let answer = answer.value();
        assert_eq!(answer["classes_created"], 2);
        assert_eq!(answer["shapes_created"], 3);
        assert_eq!(answer["shapes_existing"], 0);
        assert_eq!(answer["classes"][0]["class"]["name"], "bean");
        assert_eq!(answer["classes"][0]["class"]["shapes"], 2);
        assert_eq!(answer["classes"][0]["created"], true);
        assert_eq!(shapes_of(&answer["classes"][0]), ["a.off", "b.obj"]);
        assert_eq!(shapes_of(&answer["classes"][1]), ["old/deep/c.off"]);
        assert_eq!(answer["ignored"].as_array().unwrap().len(), 2, "{answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn classes_are_filled_and_the_same_archive_again_changes_nothing() {
    let app = App::new();
    app.post(
        "/v1/classes/bean/shapes?create=true&name=a.off",
        "model/off",
        off("bean", 0),
    )
    .await;
    let (a, b, c) = (off("bean", 0), off("bean", 1), off("star", 0));
    let archive = zip_of(&[("bean/a.off", &a), ("bean/b.off", &b), ("star/c.off", &c)]);
    let first = app.post("/v1/shapes", "application/zip", archive.clone()).await;
    assert_eq!(first.status, 201, "{}", first.text());
    let first = first.value();
    assert_eq!(
        (
            &first["classes_created"],
            &first["shapes_created"],
            &first["shapes_existing"]
        ),
        (&json!(1), &json!(2), &json!(1))
    );
    assert_eq!(first["classes"][0]["created"], false);
    assert_eq!(first["classes"][0]["shapes"][0]["existing"], true);
    // A client that lost the answer sends the same again; a key is not needed and does no harm.
    for _ in 0..2 {
        let request = Request::post("/v1/shapes")
            .header("content-type", "application/zip")
            .header("idempotency-key", "dataset-1")
            .body(Body::from(archive.clone()))
            .unwrap();
        let again = app.send(request).await;
        assert_eq!(again.status, 200, "{}", again.text());
        let again = again.value();
        assert_eq!(
            (&again["shapes_created"], &again["shapes_existing"]),
            (&json!(0), &json!(3))
        );
        let id = |answer: &Value| answer["classes"][1]["shapes"][0]["id"].clone();
        assert_eq!(id(&again), id(&first));
        assert_eq!(
            again["classes"][1]["class"]["revision"],
            first["classes"][1]["class"]["revision"]
        );
    }
    let job = app.reindex(json!({"parameters": crate::harness::small()})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dataset_is_stored_whole_or_not_at_all() {
    let app = App::new();
    let good = off("bean", 0);
    let answer = upload(
        &app,
        &[
            ("set/bean/good.off", &good),
            ("set/bean/cut.off", &good[..200]),
            ("set/star/text.obj", b"hello"),
        ],
    )
    .await;
    let problem = answer.fails(422, "upload_rejected");
    assert_eq!((&problem["failed"], &problem["total"]), (&json!(2), &json!(3)));
    assert_eq!(problem["failures"][0]["name"], "set/bean/cut.off");
    assert_eq!(problem["failures"][0]["code"], "truncated_mesh");
    assert_eq!(problem["failures"][1]["name"], "set/star/text.obj");
    assert_eq!(class_names(&app).await, [""; 0]);
    let originals = app.state.config.data_dir.join("originals");
    let left = walk(&originals);
    assert_eq!(left, 0, "files of refused datasets");
}

/// Files below a folder.
fn walk(folder: &std::path::Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return 0;
    };
    entries
        .map(|entry| entry.unwrap().path())
        .map(|path| if path.is_dir() { walk(&path) } else { 1 })
        .sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn files_outside_folders_and_names_no_class_may_have_are_named() {
    let app = App::new();
    let a = off("bean", 0);
    let uuid = "01980c63-5f0e-7d52-a3f5-8b7f5d6f9a10/a.off";
    let long = format!("{}/a.off", "x".repeat(101));
    let answer = upload(&app, &[("bean/a.off", &a), ("loose.off", &a)]).await;
    let problem = answer.fails(422, "upload_rejected");
    assert_eq!(problem["failures"].as_array().unwrap().len(), 1);
    assert_eq!(problem["failures"][0]["name"], "loose.off");
    assert_eq!(problem["failures"][0]["code"], "file_without_class");

    let hostile = [
        "zero\u{200b}width/a.off",
        "right\u{202e}left/a.off",
        "soft\u{ad}hyphen/a.off",
        uuid,
        &long,
        "\u{2028}/a.off",
        " /a.off",
    ];
    for path in hostile {
        let answer = upload(&app, &[(path, &a), ("bean/b.off", &a)]).await;
        let problem = answer.fails(422, "upload_rejected");
        assert_eq!(problem["failures"][0]["code"], "invalid_name", "{path:?}");
        let folder = path.split('/').next().unwrap();
        assert_eq!(problem["failures"][0]["folder"], folder, "{path:?}");
        upload(&app, &[(path, &a)]).await.fails(422, "invalid_name");
    }
    for path in [
        "../a.off",
        "/bean/a.off",
        "bean/../../a.off",
        "c:/bean/a.off",
        "be\nan/a.off",
    ] {
        let answer = app
            .post("/v1/shapes", "application/zip", zip_of(&[(path, &a)]))
            .await;
        answer.fails(422, "unsafe_archive_path");
    }
    app.post("/v1/shapes", "model/off", a.clone())
        .await
        .fails(422, "file_without_class");
    let (media_type, body) = multipart(&[("bean/a.off", &a)]);
    app.post("/v1/shapes", &media_type, body)
        .await
        .fails(422, "file_without_class");
    let nested = zip_of(&[("bean/a.zip", &zip_of(&[("bean/a.off", &a)]))]);
    app.post("/v1/shapes", "application/zip", nested)
        .await
        .fails(422, "nested_archive");
    app.post(
        "/v1/shapes",
        "application/zip",
        zip_of(&[("bean/notes.txt", b"x")]),
    )
    .await
    .fails(400, "no_files");
    app.post(
        "/v1/shapes?poses=0",
        "application/zip",
        zip_of(&[("bean/a.off", &a)]),
    )
    .await
    .fails(400, "invalid_query");
    assert_eq!(class_names(&app).await, [""; 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_of_one_name_are_one_class() {
    let app = App::new();
    let (a, b, c, d) = (off("bean", 0), off("bean", 1), off("bean", 2), off("star", 0));
    let answer = upload(
        &app,
        &[
            ("caf\u{e9}/a.off", &a),
            ("cafe\u{301}/b.off", &b),
            ("caf\u{e9} /c.off", &c),
            ("Caf\u{e9}/d.off", &d),
        ],
    )
    .await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    let answer = answer.value();
    assert_eq!(answer["classes_created"], 2);
    assert_eq!(shapes_of(&answer["classes"][0]), ["a.off", "b.off", "c.off"]);
    assert_eq!(class_names(&app).await, ["Caf\u{e9}", "caf\u{e9}"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_quota_holds_for_the_whole_archive() {
    let app = App::new();
    let owner = app
        .post_as_owner(
            "/v1/keys",
            "application/json",
            json!({"name": "owner", "scope": "admin"}).to_string(),
        )
        .await;
    let owner = owner.value()["secret"].as_str().unwrap().to_owned();
    let (a, b, c) = (off("bean", 0), off("star", 0), off("bottle", 0));
    let bytes = a.len() + b.len();
    let body = json!({"name": "w", "scope": "write", "max_classes": 2, "max_stored_bytes": bytes});
    let made = send(
        &app,
        &owner,
        "/v1/keys",
        "application/json",
        body.to_string().into_bytes(),
    )
    .await;
    assert_eq!(made.status, 201, "{}", made.text());
    let key = made.value()["secret"].as_str().unwrap().to_owned();
    let zip = |files: &[(&str, &[u8])]| zip_of(files);
    let three = zip(&[("a/a.off", &a), ("b/b.off", &b), ("c/c.off", &c)]);
    let refused = send(&app, &key, "/v1/shapes", "application/zip", three).await;
    assert_eq!(refused.fails(403, "quota_exceeded")["quota"], "classes");
    let large = zip(&[("a/a.off", &a), ("b/b.off", &b), ("b/c.off", &c)]);
    let refused = send(&app, &key, "/v1/shapes", "application/zip", large).await;
    assert_eq!(refused.fails(403, "quota_exceeded")["quota"], "stored_bytes");
    // To the byte.
    let exact = zip(&[("a/a.off", &a), ("b/b.off", &b)]);
    let fits = send(&app, &key, "/v1/shapes", "application/zip", exact.clone()).await;
    assert_eq!(fits.status, 201, "{}", fits.text());
    assert_eq!(fits.value()["classes_created"], 2);
    let more = zip(&[("a/a.off", &a), ("d/d.off", &a)]);
    send(&app, &key, "/v1/shapes", "application/zip", more)
        .await
        .fails(403, "quota_exceeded");
    assert_eq!(app.state.store.statistics().unwrap().classes, 2);
}

async fn send(app: &App, key: &str, path: &str, media_type: &str, body: Vec<u8>) -> crate::harness::Answer {
    let request = Request::post(path)
        .header("authorization", format!("Bearer {key}"))
        .header("content-type", media_type)
        .body(Body::from(body))
        .unwrap();
    app.send(request).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gltf_of_a_dataset_finds_its_own_buffer_and_its_poses() {
    let app = App::new();
    let (one, one_buffer) = mesh("bean", 0).gltf("b.bin");
    let (two, two_buffer) = mesh("star", 0).gltf("b.bin");
    let animated = mesh("bottle", 0).animated();
    let archive = zip_of(&[
        ("bean/x.gltf", &one),
        ("bean/b.bin", &one_buffer),
        ("star/x.gltf", &two),
        ("star/b.bin", &two_buffer),
    ]);
    let answer = app.post("/v1/shapes", "application/zip", archive).await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    let answer = answer.value();
    let area = |class: usize| {
        answer["classes"][class]["shapes"][0]["report"]["area"]
            .as_f64()
            .unwrap()
    };
    assert!((area(0) - area(1)).abs() > 1e-3);
    let archive = zip_of(&[("bottle/x.glb", &animated)]);
    let answer = app.post("/v1/shapes?poses=3", "application/zip", archive).await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    let shapes = answer.value()["classes"][0]["shapes"].clone();
    assert_eq!(shapes.as_array().unwrap().len(), 3);
    assert_eq!(shapes[2]["pose"]["index"], 2);
}
