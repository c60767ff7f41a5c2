//! Queries with stored shapes and with poses of animated files.

use crate::harness::{App, multipart};
use crate::meshes::{mesh, off};
use serde_json::Value;
use std::path::PathBuf;

/// The first shape of a class.
async fn first_shape(app: &App, class: &str) -> Value {
    let shapes = app.get(&format!("/v1/classes/{class}/shapes")).await.value();
    shapes["items"][0].clone()
}

async fn ask(app: &App, query: &str) -> crate::harness::Answer {
    app.call("POST", &format!("/v1/query?{query}"), None, "").await
}

fn lines(text: &str) -> Vec<Value> {
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_shape_is_answered_as_its_file_is() {
    let app = App::indexed().await;
    let shape = first_shape(&app, "bean").await;
    let id = shape["id"].as_str().unwrap();
    let sent = app
        .post("/v1/query?name=x.off", "model/off", off("bean", 0))
        .await
        .value();
    let class = shape["class"].as_str().unwrap();
    for named in [
        id.to_owned(),
        format!("bean/{id}"),
        format!("bean%2F{id}"),
        format!("{class}/{id}"),
    ] {
        let answer = ask(&app, &format!("shape={named}&top=2")).await;
        assert_eq!(answer.status, 200, "{named}: {}", answer.text());
        let answer = answer.value();
        assert_eq!(answer["name"], shape["name"]);
        assert_eq!(answer["pose"], Value::Null);
        assert_eq!(answer["classes"][0], sent["classes"][0], "{named}");
        assert_eq!(answer["mesh"], sent["mesh"]);
        assert_eq!(answer["classes"].as_array().unwrap().len(), 2);
    }
    let batch = app
        .call("POST", &format!("/v1/query/batch?shape={id}"), None, "")
        .await;
    let batch = lines(&batch.text());
    assert_eq!(batch[0]["classes"][0], sent["classes"][0]);
    assert_eq!(batch[1]["summary"]["ok"], 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_names_no_stored_shape_is_told_so() {
    let app = App::indexed().await;
    let shape = first_shape(&app, "bean").await;
    let id = shape["id"].as_str().unwrap();
    let other = "01980c63-5f0e-7d52-a3f5-8b7f5d6f9a10";
    for (named, status, code) in [
        (other.to_owned(), 404, "shape_not_found"),
        ("bean".to_owned(), 404, "shape_not_found"),
        (String::new(), 404, "shape_not_found"),
        (format!("bean/{other}"), 404, "shape_not_found"),
        ("bean/bean0.off".to_owned(), 404, "shape_not_found"),
        (format!("star/{id}"), 404, "shape_not_found"),
        (format!("nowhere/{id}"), 404, "class_not_found"),
        (format!("/{id}"), 404, "class_not_found"),
        (format!("..%2f..%2f{id}"), 404, "class_not_found"),
    ] {
        let path = format!("shape={named}");
        ask(&app, &path).await.fails(status, code);
    }
    let both = app
        .post(&format!("/v1/query?shape={id}"), "model/off", off("bean", 0))
        .await;
    both.fails(400, "one_mesh_expected");
    let hash = shape["hash"].as_str().unwrap();
    let path: PathBuf = app
        .state
        .config
        .data_dir
        .join("originals")
        .join(&hash[..2])
        .join(hash);
    std::fs::write(&path, "changed").unwrap();
    ask(&app, &format!("shape={id}"))
        .await
        .fails(500, "original_damaged");
    std::fs::remove_file(&path).unwrap();
    ask(&app, &format!("shape={id}"))
        .await
        .fails(500, "original_missing");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_shape_brings_its_buffers_and_its_pose() {
    let app = App::indexed().await;
    let (document, buffer) = mesh("bean", 0).gltf("parts/b.bin");
    let (media_type, body) = multipart(&[("x.gltf", &document), ("b.bin", &buffer)]);
    let added = app
        .post("/v1/classes/gltf/shapes?create=true", &media_type, body)
        .await;
    let id = added.value()["shapes"][0]["id"].as_str().unwrap().to_owned();
    let answer = ask(&app, &format!("shape={id}")).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.value()["classes"][0]["class"]["name"], "bean");

    let animated = mesh("bean", 1).animated();
    let added = app
        .post(
            "/v1/classes/poses/shapes?create=true&poses=3",
            "model/gltf-binary",
            animated.clone(),
        )
        .await;
    assert_eq!(added.status, 201, "{}", added.text());
    for (i, shape) in added.value()["shapes"].as_array().unwrap().iter().enumerate() {
        let answer = ask(&app, &format!("shape=poses/{}", shape["id"].as_str().unwrap())).await;
        assert_eq!(answer.status, 200, "{}", answer.text());
        let answer = answer.value();
        assert_eq!(answer["pose"], shape["pose"]);
        assert_eq!(answer["mesh"]["area"], shape["report"]["area"]);
        let sent = app
            .post(
                &format!("/v1/query?poses=3&pose={i}"),
                "model/gltf-binary",
                animated.clone(),
            )
            .await;
        assert_eq!(sent.status, 200, "{}", sent.text());
        assert_eq!(sent.value()["classes"], answer["classes"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_batch_answers_every_pose() {
    let app = App::indexed().await;
    let animated = mesh("bean", 1).animated();
    let (media_type, body) = multipart(&[("stretch.glb", &animated), ("still.off", &off("bean", 0))]);
    let answer = app
        .post("/v1/query/batch?poses=4&top=1", &media_type, body.clone())
        .await;
    let mut lines = lines(&answer.text());
    let summary = lines.pop().unwrap();
    assert_eq!(
        summary["summary"],
        serde_json::json!({"total": 5, "ok": 4, "failed": 1})
    );
    let mut poses: Vec<(u64, String)> = Vec::new();
    for line in &lines {
        if line["status"] == "failed" {
            assert_eq!(line["index"], 1);
            assert_eq!(line["problem"]["code"], "no_animation");
            assert!(line.get("pose").is_none());
        } else {
            assert_eq!(line["index"], 0);
            assert_eq!(line["pose"]["of"], 4);
            let label = line["pose"]["label"].as_str().unwrap().to_owned();
            poses.push((line["pose"]["index"].as_u64().unwrap(), label));
        }
    }
    poses.sort();
    let expected = [
        (0, "Stretch@0.12"),
        (1, "Stretch@0.38"),
        (2, "Stretch@0.62"),
        (3, "Stretch@0.88"),
    ];
    assert_eq!(poses, expected.map(|(i, label)| (i, label.to_owned())));

    let one = app
        .post("/v1/query/batch?poses=4&pose=2", &media_type, body)
        .await;
    assert_eq!(
        crate::stored_queries::lines(&one.text())[2]["summary"]["total"],
        2
    );
    assert_eq!(app.state.memory.used(), 0, "memory of poses is given back");
}

#[tokio::test(flavor = "multi_thread")]
async fn poses_have_the_limits_of_an_upload() {
    let app = App::indexed().await;
    let animated = mesh("bean", 1).animated();
    for (query, name) in [
        ("poses=0", "poses"),
        ("poses=65", "poses"),
        ("pose=0", "pose"),
        ("poses=3&pose=3", "pose"),
    ] {
        for path in ["/v1/query", "/v1/query/batch"] {
            let refused = app
                .post(&format!("{path}?{query}"), "model/gltf-binary", animated.clone())
                .await;
            assert_eq!(refused.fails(400, "invalid_query")["name"], name, "{query}");
        }
    }
    let several = app
        .post("/v1/query?poses=3", "model/gltf-binary", animated.clone())
        .await;
    assert_eq!(several.fails(400, "one_mesh_expected")["found"], 3);
    let one = app.post("/v1/query?poses=1", "model/gltf-binary", animated).await;
    assert_eq!(one.value()["pose"]["label"], "Stretch@0.50");
    let still = app.post("/v1/query?poses=1", "model/off", off("bean", 0)).await;
    still.fails(422, "no_animation");
}
