//! Ranking by the methods the paper compares with.

use crate::harness::{App, multipart};
use crate::meshes::{CLASSES, mesh, off};
use serde_json::json;
use shapelex::store::{Store, StoreOptions};
use std::path::Path;
use std::time::{Duration, Instant};

const BASELINES: [&str; 4] = [
    "shape_dna",
    "shape_dna_relative",
    "signature_distances",
    "bag_of_words",
];

#[tokio::test(flavor = "multi_thread")]
async fn every_baseline_ranks_the_true_class_first() {
    let app = App::indexed().await;
    for method in BASELINES {
        for class in CLASSES {
            let answer = app
                .post(
                    &format!("/v1/query?rank_by={method}"),
                    "model/obj",
                    mesh(class, 4).obj(),
                )
                .await;
            assert_eq!(answer.status, 200, "{}", answer.text());
            let body = answer.value();
            assert_eq!(body["rank_by"], method);
            let best = &body["classes"][0];
            assert_eq!(best["class"]["name"], class, "{method}: {body}");
            assert!(best["margin"].as_f64().unwrap() > 0.0);
            // What only sparse coding knows is there, and null.
            for member in [
                "reconstruction_error",
                "relative_error",
                "mean_objective",
                "trimmed_objective",
                "mean_nonzeros",
                "hypothesis",
            ] {
                assert!(best.get(member).unwrap().is_null(), "{member}: {best}");
            }
            assert_eq!(body["signatures"], 0);
            // Every training shape is ranked, and the class has the distance of its nearest.
            let shapes = body["nearest_shapes"].as_array().unwrap();
            assert_eq!(shapes.len(), 9);
            assert_eq!(shapes[0]["score"], best["score"]);
            assert_eq!(shapes[0]["class"]["name"], class);
        }
        // A training shape is its own nearest: histograms are kept at single precision.
        let own = app
            .post(
                &format!("/v1/query?rank_by={method}&top=1"),
                "model/off",
                off("star", 1),
            )
            .await
            .value();
        assert!(own["classes"][0]["score"].as_f64().unwrap() < 1e-6, "{own}");
        assert_eq!(own["classes"].as_array().unwrap().len(), 1);
        assert_eq!(own["nearest_shapes"].as_array().unwrap().len(), 1);
        assert_eq!(own["compared"], 3);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_batch_may_be_ranked_by_a_baseline_and_deleted_classes_are_left_out() {
    let app = App::indexed().await;
    assert_eq!(app.delete("/v1/classes/bean").await.status, 204);
    let (star, bottle) = (off("star", 4), off("bottle", 4));
    let (media_type, body) = multipart(&[("star.off", &star), ("bottle.off", &bottle)]);
    let answer = app
        .post("/v1/query/batch?rank_by=shape_dna", &media_type, body)
        .await;
    let text = answer.text();
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines.len(), 3, "{text}");
    for line in &lines[..2] {
        assert_eq!(line["status"], "ok");
        assert_eq!(line["rank_by"], "shape_dna");
        assert_eq!(line["compared"], 2);
        let class = line["classes"][0]["class"]["name"].as_str().unwrap();
        assert!(line["name"].as_str().unwrap().starts_with(class), "{line}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_class_more_is_described_by_the_same_words() {
    let app = App::indexed().await;
    let more = app
        .post("/v1/classes/bottle/shapes", "model/off", off("bottle", 5))
        .await;
    assert_eq!(more.status, 201);
    let job = app.reindex(json!({})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let steps: Vec<&str> = job["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["name"].as_str().unwrap())
        .collect();
    assert!(steps.contains(&"learn baselines"), "{steps:?}");
    let body = app
        .post("/v1/query?rank_by=bag_of_words", "model/off", off("bottle", 5))
        .await
        .value();
    assert_eq!(body["nearest_shapes"].as_array().unwrap().len(), 10);
    assert!(body["classes"][0]["score"].as_f64().unwrap() < 1e-6, "{body}");
}

/// Opens a data directory as soon as the service that had it has let go of it.
fn open(path: &Path) -> Store {
    let began = Instant::now();
    loop {
        match Store::open(path, &StoreOptions::default()) {
            Ok(store) => return store,
            Err(error) => assert!(began.elapsed() < Duration::from_secs(10), "{error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_index_without_baselines_says_to_reindex() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_owned();
    {
        let app = App::with(|config| config.data_dir = path.clone());
        for class in CLASSES {
            let at = format!("/v1/classes/{class}/shapes?create=true");
            assert_eq!(app.post(&at, "model/off", off(class, 0)).await.status, 201);
        }
        let job = app.reindex(json!({"parameters": crate::harness::small()})).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        assert!(app.state.jobs.shutdown(Duration::from_secs(10)));
    }
    // As an older shapelex left it: the generation names no baselines.
    {
        let store = open(&path);
        let mut generation = store.generation().unwrap().unwrap();
        generation.number = store.next_generation_number().unwrap();
        assert!(generation.baselines.take().is_some());
        store.put_generation_and_switch(&generation).unwrap();
        assert_eq!(store.collect_garbage().unwrap().baselines, 4);
        assert!(store.load_baselines(&generation).unwrap().is_none());
    }
    let app = App::with(|config| config.data_dir = path.clone());
    let body = app
        .post("/v1/query?rank_by=shape_dna", "model/off", off("bean", 1))
        .await
        .fails(409, "baselines_missing");
    assert_eq!(body["next"], "/v1/reindex");
    assert_eq!(body["rank_by"], "shape_dna");
    // Sparse coding does without, and a reindex in which no class is stale adds them.
    assert_eq!(
        app.post("/v1/query", "model/off", off("bean", 1)).await.status,
        200
    );
    let job = app.reindex(json!({})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["result"]["relearned"], json!([]));
    let after = app
        .post("/v1/query?rank_by=shape_dna", "model/off", off("bean", 1))
        .await;
    assert_eq!(
        after.value()["classes"][0]["class"]["name"],
        "bean",
        "{}",
        after.text()
    );
}
