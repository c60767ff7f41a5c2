//! What an answer says: verdicts in words, samples to compute a score from, pages of the index, events of a job.

use crate::harness::{App, small};
use crate::meshes::off;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use shapelex::http::AppState;
use shapelex::http::ServiceConfig;
use shapelex_eval::sample::{Species, ZooOptions, write_obj};
use std::process::Command;

fn pose(species: &Species, pose: usize) -> Vec<u8> {
    write_obj(&species.pose(3, pose, &ZooOptions::default()).unwrap())
}

fn frame(species: &Species, time: f64) -> Vec<u8> {
    write_obj(&species.walk(3, time, &ZooOptions::default()).unwrap())
}

async fn teach(app: &App, class: &str, shapes: Vec<Vec<u8>>) {
    for shape in shapes {
        let path = format!("/v1/classes/{class}/shapes?create=true");
        let answer = app.post(&path, "model/obj", shape).await;
        assert_eq!(answer.status, 201, "{}", answer.text());
    }
}

async fn ask(app: &App, shape: Vec<u8>, options: &str) -> Value {
    let answer = app.post(&format!("/v1/query{options}"), "model/obj", shape).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    answer.value()
}

/// Frames of walks train and their later frames are queried: nothing of that is foreign, though nothing proves it.
#[tokio::test(flavor = "multi_thread")]
async fn verdicts_are_said_in_words_and_walks_are_not_refused() {
    let app = App::new();
    let named = Species::named();
    let (walker, posed, foreign) = (&named[0], &named[2..5], &named[6]);
    teach(
        &app,
        "walker",
        (0..8).map(|i| frame(walker, 0.01 * f64::from(i))).collect(),
    )
    .await;
    for species in posed {
        teach(&app, species.name(), (0..8).map(|i| pose(species, i)).collect()).await;
    }
    let job = app.reindex(json!({})).await;
    assert_eq!(job["state"], "succeeded", "{job}");

    let mut named_kinds = 0;
    for species in posed {
        let answer = ask(&app, pose(species, 20), "").await;
        let verdict = &answer["verdict"];
        assert_eq!(answer["classes"][0]["class"]["name"], species.name());
        assert!(
            verdict["text"].as_str().unwrap().contains(species.name()),
            "{verdict}"
        );
        assert_eq!(answer["probability"], verdict["probability"]);
        assert_eq!(answer["margin"], answer["classes"][0]["margin"]);
        assert_eq!(answer["confidence"], answer["margin"]);
        named_kinds += usize::from(["class", "several"].contains(&verdict["kind"].as_str().unwrap()));
        // It is about the first few, however many are answered.
        let one = ask(&app, pose(species, 20), "?top=1").await;
        assert_eq!(
            (&one["verdict"], one["classes"].as_array().unwrap().len()),
            (verdict, 1)
        );
    }
    assert!(named_kinds >= 2, "{named_kinds} of 3");
    for time in [0.2, 0.35, 0.5, 0.65, 0.8] {
        let answer = ask(&app, frame(walker, time), "").await;
        assert_eq!(answer["classes"][0]["class"]["name"], "walker");
        assert_eq!(answer["verdict"]["kind"], "not_judged", "{}", answer["verdict"]);
        assert!(
            answer["verdict"]["text"]
                .as_str()
                .unwrap()
                .starts_with("nearest: walker (not judged: ")
        );
        assert!(answer["classes"][0]["p_value"].is_null() && answer["none_of_these"].is_null());
    }
    let answer = ask(&app, pose(foreign, 1), "").await;
    let nearest = answer["classes"][0]["class"]["name"].as_str().unwrap();
    assert_eq!(
        answer["verdict"]["text"],
        format!("none of the known classes; nearest: {nearest}"),
        "{}",
        answer["classes"]
    );
    assert_eq!(
        (&answer["verdict"]["kind"], &answer["none_of_these"]),
        (&json!("none_of_these"), &json!(true))
    );
    let other = ask(&app, pose(foreign, 1), "?rank_by=shape_dna").await;
    assert_eq!(other["verdict"]["kind"], "not_judged");
}

/// Bounds of min_a ½‖s − Da‖² + λ‖a‖₁: the objective that cyclic coordinate descent comes to, and the dual value θᵀs − ½‖θ‖²
/// of its residual, made short enough for ‖Dᵀθ‖∞ ≤ λ.
fn lasso(atoms: &[Vec<f64>], signal: &[f64], lambda: f64) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut code = vec![0.0; atoms.len()];
    let mut rest = signal.to_vec();
    for _ in 0..2000 {
        for (value, atom) in code.iter_mut().zip(atoms) {
            let square = dot(atom, atom);
            let target = dot(atom, &rest) + square * *value;
            let next = target.signum() * (target.abs() - lambda).max(0.0) / square;
            let step = next - *value;
            rest.iter_mut().zip(atom).for_each(|(r, d)| *r -= step * d);
            *value = next;
        }
    }
    let upper = 0.5 * dot(&rest, &rest) + lambda * code.iter().map(|a: &f64| a.abs()).sum::<f64>();
    let largest = atoms
        .iter()
        .map(|atom| dot(atom, &rest).abs())
        .fold(0.0, f64::max);
    let scale = (lambda / largest).min(1.0);
    (
        scale * dot(&rest, signal) - 0.5 * scale * scale * dot(&rest, &rest),
        upper,
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_score_is_computed_again_from_the_export_and_the_samples() {
    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    let config = ServiceConfig {
        data_dir: data.clone(),
        ..ServiceConfig::default()
    };
    let app = App::on(AppState::open(config).unwrap());
    for class in ["bean", "star"] {
        for pose in 0..2 {
            let path = format!("/v1/classes/{class}/shapes?create=true");
            app.post(&path, "model/off", off(class, pose)).await;
        }
    }
    assert_eq!(
        app.reindex(json!({"parameters": small()})).await["state"],
        "succeeded"
    );
    let answer = app
        .post("/v1/query?details=samples", "model/off", off("star", 4))
        .await
        .value();
    assert!(
        app.post("/v1/query", "model/off", off("star", 4))
            .await
            .value()
            .get("samples")
            .is_none()
    );
    app.post("/v1/query?details=everything", "model/off", off("star", 4))
        .await
        .fails(400, "invalid_query");
    drop(app);
    let file = directory.path().join("x.safetensors");
    let export = Command::new(env!("CARGO_BIN_EXE_shapelex"))
        .args(["export", "--data"])
        .arg(&data)
        .arg("--out")
        .arg(&file)
        .output()
        .unwrap();
    assert!(
        export.status.success(),
        "{}",
        String::from_utf8_lossy(&export.stderr)
    );
    let bytes = std::fs::read(&file).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let samples = answer["samples"].as_array().unwrap();
    assert_eq!((samples.len(), &samples[0]["channel"]), (1, &json!("plain")));
    let signals: Vec<Vec<f64>> = serde_json::from_value(samples[0]["signals"].clone()).unwrap();
    assert_eq!(signals.len(), samples[0]["vertices"].as_array().unwrap().len());
    assert_eq!(json!(signals.len()), answer["signatures"]);
    let lambda = answer["parameters"]["lambda"].as_f64().unwrap();
    for class in answer["classes"].as_array().unwrap() {
        let tensor = tensors
            .tensor(&format!("{}/plain", class["class"]["name"].as_str().unwrap()))
            .unwrap();
        let &[rows, columns] = tensor.shape() else {
            panic!("a matrix")
        };
        let values: Vec<f64> = tensor
            .data()
            .chunks(4)
            .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
            .collect();
        let atoms: Vec<Vec<f64>> = (0..columns)
            .map(|j| (0..rows).map(|i| values[i * columns + j]).collect())
            .collect();
        let bounds: Vec<(f64, f64)> = signals.iter().map(|s| lasso(&atoms, s, lambda)).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| bounds.iter().map(of).sum::<f64>() / bounds.len() as f64;
        let (lower, upper) = (mean(|b| b.0), mean(|b| b.1));
        let score = class["score"].as_f64().unwrap();
        assert!(
            lower - 1e-9 <= score && score <= upper + 1e-9,
            "{lower} to {upper}, {score}"
        );
        assert!(upper - lower < 1e-4, "{lower} to {upper}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_index_is_paged_and_tells_what_is_resident() {
    let app = App::indexed().await;
    let whole = app.get("/v1/index").await.value();
    assert_eq!(
        (whole["classes"].as_array().unwrap().len(), &whole["next_cursor"]),
        (3, &Value::Null)
    );
    assert_eq!(
        whole["totals"],
        json!({"classes": 3, "current": 3, "stale": 0, "not_indexed": 0})
    );
    let first = app.get("/v1/index?limit=2").await.value();
    let cursor = first["next_cursor"].as_str().unwrap();
    let second = app
        .get(&format!("/v1/index?limit=2&cursor={cursor}"))
        .await
        .value();
    let names = |page: &Value| -> Vec<Value> {
        page["classes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c["name"].clone())
            .collect()
    };
    assert_eq!([names(&first), names(&second)].concat(), names(&whole));
    assert_eq!(
        (&second["next_cursor"], &second["totals"]),
        (&Value::Null, &whole["totals"])
    );
    assert_eq!(second["bytes"], whole["bytes"]);
    app.get("/v1/index?limit=0").await.fails(400, "invalid_query");
    app.get("/v1/index?cursor=x").await.fails(400, "invalid_cursor");

    // Atoms alone before the first query, which prepares what it is coded under.
    let class = &whole["classes"][0];
    let (stored, kept) = (
        class["bytes"].as_u64().unwrap(),
        class["resident_bytes"].as_u64().unwrap(),
    );
    assert!(kept <= stored && kept > stored / 2, "{kept} of {stored}");
    app.post("/v1/query", "model/off", off("star", 4)).await;
    let after = app.get("/v1/index").await.value();
    assert!(after["classes"][0]["resident_bytes"].as_u64().unwrap() > kept);
    assert!(after["resident_bytes"].as_u64() > whole["resident_bytes"].as_u64());
    assert_eq!(after["classes"][0]["origin"], "learnt");
}

fn events(text: &str) -> Vec<(u64, Value)> {
    let mut found = Vec::new();
    for block in text.split("\n\n").filter(|block| block.contains("data:")) {
        let line = |name: &str| {
            let line = block.lines().find(|line| line.starts_with(name)).unwrap();
            line[name.len()..].trim().to_owned()
        };
        found.push((
            line("id:").parse().unwrap(),
            serde_json::from_str(&line("data:")).unwrap(),
        ));
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn events_have_growing_ids_and_the_parameters_once() {
    let app = App::indexed().await;
    let mut parameters = small();
    parameters["lambda"] = json!(0.3);
    let started = app
        .json(
            "POST",
            "/v1/reindex",
            json!({"scope": "all", "parameters": parameters}),
        )
        .await
        .value();
    let path = format!("/v1/jobs/{}/events", started["id"].as_str().unwrap());
    let all = events(&app.get(&path).await.text());
    assert!(all.windows(2).all(|two| two[0].0 < two[1].0), "{all:?}");
    assert!(all[0].1.get("parameters").is_some());
    assert!(
        all[1..].iter().all(|(_, job)| job.get("parameters").is_none()),
        "{all:?}"
    );
    let (last, job) = all.last().unwrap();
    assert_eq!(job["state"], "succeeded");
    // Somebody who saw all but the last gets that one, somebody who saw it nothing more.
    let from = |id: u64| {
        Request::get(&path)
            .header("last-event-id", id.to_string())
            .body(Body::empty())
            .unwrap()
    };
    let missed = events(&app.send(from(last - 1)).await.text());
    assert_eq!((missed.len(), missed[0].0), (1, *last));
    assert_eq!(app.send(from(*last)).await.status, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scope_is_null_or_said_with_its_path() {
    let app = App::indexed().await;
    let job = app.reindex(json!({"scope": null})).await;
    assert_eq!(
        (&job["state"], &job["scope"]),
        (&json!("succeeded"), &json!("stale"))
    );
    for (body, name, said) in [
        (json!({"scope": ["star"]}), "scope", r#"{"classes""#),
        (json!({"scope": 5}), "scope", "\"stale\""),
        (json!({"scope": {"classes": "star"}}), "scope", "\"all\""),
        (json!({"scope": {"classes": [5]}}), "scope", "found"),
        (
            json!({"scope": {"classes": []}}),
            "scope.classes",
            "names no class",
        ),
        (json!({"preset": ["fast"]}), "preset", "expected"),
        (json!({"parameters": {"rank_by": 5}}), "parameters", "rank_by"),
        (json!({"parameters": {"atoms": "many"}}), "parameters", "atoms"),
    ] {
        let problem = app
            .json("POST", "/v1/reindex", body.clone())
            .await
            .fails(422, "invalid_field");
        assert_eq!(problem["name"], name, "{body}: {problem}");
        assert!(
            problem["detail"].as_str().unwrap().contains(said),
            "{body}: {problem}"
        );
    }
    app.call("POST", "/v1/reindex", Some("application/json"), r#"{"scope": "#)
        .await
        .fails(400, "invalid_json");
    app.call(
        "POST",
        "/v1/reindex",
        Some("application/json"),
        r#"{"scope": 5} x"#,
    )
    .await
    .problem();
}
