//! What came of many queries.

use super::output;
use super::verdict::{self, Kind};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Counts over many queries.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Meshes.
    pub total: usize,
    /// Meshes that were answered.
    pub answered: usize,
    /// Meshes that could not be used.
    pub refused: usize,
    /// Answers that the mesh is of none of the known classes.
    pub none_of_these: usize,
    /// How often each class was the best; answers "none of the known classes" are not counted here.
    pub by_class: BTreeMap<String, usize>,
    /// Comparison with the folders' names, where there are some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tally: Option<Tally>,
}

/// Answers beside the classes that subfolders name.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// All classes together.
    #[serde(flatten)]
    pub all: Counts,
    /// By the true class.
    pub classes: BTreeMap<String, Counts>,
}

/// How answers compare with the true class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// The true class.
    pub right: usize,
    /// Another class.
    pub wrong: usize,
    /// "None of the known classes".
    pub none: usize,
}

impl Counts {
    fn add(&mut self, kind: Kind, right: bool) {
        match (kind, right) {
            (Kind::NoneOfThese, _) => self.none += 1,
            (Kind::Class, true) => self.right += 1,
            (Kind::Class, false) => self.wrong += 1,
        }
    }

    /// Share of right answers, 0 to 1; 0 of none.
    pub fn accuracy(&self) -> f64 {
        let total = self.right + self.wrong + self.none;
        self.right as f64 / total.max(1) as f64
    }

    fn row(&self, name: &str) -> Vec<String> {
        vec![
            name.to_owned(),
            self.right.to_string(),
            self.wrong.to_string(),
            self.none.to_string(),
            format!("{:.1} %", 100.0 * self.accuracy()),
        ]
    }
}

impl Summary {
    /// Counts an answer to a mesh whose class may be known.
    pub fn add(&mut self, answer: &Value, class: Option<&str>) {
        let (kind, best) = (verdict::kind(answer), verdict::best(answer));
        self.total += 1;
        self.answered += 1;
        match kind {
            Kind::NoneOfThese => self.none_of_these += 1,
            Kind::Class => *self.by_class.entry(best.clone()).or_default() += 1,
        }
        if let Some(class) = class {
            let tally = self.tally.get_or_insert_default();
            tally.all.add(kind, best == class);
            tally
                .classes
                .entry(class.to_owned())
                .or_default()
                .add(kind, best == class);
        }
    }

    /// Counts a mesh that could not be used.
    pub fn refuse(&mut self) {
        self.total += 1;
        self.refused += 1;
    }

    /// The counts as JSON, with the accuracies.
    pub fn json(&self) -> Value {
        let mut value = serde_json::json!({ "summary": self });
        if let Some(tally) = &self.tally {
            value["summary"]["tally"]["accuracy"] = tally.all.accuracy().into();
        }
        value
    }

    /// The counts for people.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} of {} meshes answered, {} refused; {} of none of the known classes",
            self.answered, self.total, self.refused, self.none_of_these
        );
        if let Some(tally) = &self.tally {
            let header = ["class of the folder", ">right", ">wrong", ">none", ">accuracy"];
            let mut rows: Vec<Vec<String>> = tally.classes.iter().map(|(name, c)| c.row(name)).collect();
            rows.push(tally.all.row("all"));
            text += &format!("\n{}", output::table(&header, &rows));
        } else if !self.by_class.is_empty() {
            let rows: Vec<Vec<String>> = self
                .by_class
                .iter()
                .map(|(name, count)| vec![name.clone(), count.to_string()])
                .collect();
            text += &format!("\n{}", output::table(&["answered class", ">meshes"], &rows));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn answers_are_counted_by_class_and_against_the_folders() {
        let answer = |best: &str, none: bool| json!({ "classes": [{ "class": { "name": best } }], "none_of_these": none });
        let mut summary = Summary::default();
        summary.add(&answer("cat", false), Some("cat"));
        summary.add(&answer("dog", false), Some("cat"));
        summary.add(&answer("cat", true), Some("cat"));
        summary.add(&answer("dog", false), None);
        summary.refuse();
        let json = summary.json();
        let counts = &json["summary"];
        assert_eq!(
            (counts["total"].as_u64(), counts["answered"].as_u64()),
            (Some(5), Some(4))
        );
        assert_eq!(
            (counts["refused"].as_u64(), counts["none_of_these"].as_u64()),
            (Some(1), Some(1))
        );
        assert_eq!(counts["by_class"], json!({ "cat": 1, "dog": 2 }));
        assert_eq!(
            counts["tally"]["classes"]["cat"],
            json!({ "right": 1, "wrong": 1, "none": 1 })
        );
        assert!((counts["tally"]["accuracy"].as_f64().unwrap() - 1.0 / 3.0).abs() < 1e-15);
        assert!(
            summary
                .text()
                .contains("4 of 5 meshes answered, 1 refused; 1 of none")
        );
    }
}
