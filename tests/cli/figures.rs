//! `evaluate --figures`.

use crate::{answer, last_json};

#[test]
fn coverage_is_measured_and_drawn_over_the_level() {
    let dir = tempfile::tempdir().unwrap();
    answer(
        dir.path(),
        &[
            "zoo",
            "--out",
            "shapes",
            "--classes",
            "4",
            "--poses",
            "10",
            "--min-vertices",
            "400",
            "--max-vertices",
            "500",
        ],
    );
    let args = [
        "evaluate",
        "shapes",
        "--json",
        "--protocol",
        "open-set",
        "--draws",
        "2",
        "--figures",
        "figures",
        "--set",
        "atoms=16",
        "--set",
        "samples_per_shape=200",
        "--set",
        "eigenpairs=80",
        "--set",
        "refine_below=0",
    ];
    let report = last_json(&answer(dir.path(), &args));
    let open_set = &report["open_set"];
    let levels = open_set["by_level"].as_array().unwrap();
    let at = |i: usize, member: &str| levels[i]["covered"][member].as_u64().unwrap();
    assert!(levels.len() >= 5);
    for i in 0..levels.len() {
        assert_eq!(
            at(i, "total"),
            open_set["covered"]["total"].as_u64().unwrap(),
            "both draws are summed"
        );
        assert!(
            i == 0 || at(i, "count") <= at(i - 1, "count"),
            "a stricter level covers less: {open_set}"
        );
    }
    let usual = levels.iter().find(|l| l["level"] == 0.05).unwrap();
    assert_eq!(usual["covered"], open_set["covered"]);
    let svg = std::fs::read_to_string(dir.path().join("figures/open-set-coverage.svg")).unwrap();
    assert!(
        svg.contains("as promised") && svg.contains("the true class is possible"),
        "{svg}"
    );
}
