//! What the demo found out.

use super::{output, query_text, verdict};
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// Ranked tables that are printed.
const EXAMPLES: usize = 3;
/// Classes of a printed ranking.
const EXAMPLE_CLASSES: usize = 5;

/// A query's answer beside the truth.
#[derive(Clone, Debug)]
pub struct Answer {
    class: String,
    name: String,
    value: Value,
}

impl Answer {
    /// The API's answer to a pose of `class`.
    pub fn new(class: &str, name: &str, value: Value) -> Self {
        Self {
            class: class.to_owned(),
            name: name.to_owned(),
            value,
        }
    }

    fn answered(&self) -> &str {
        self.value["classes"][0]["class"]["name"]
            .as_str()
            .unwrap_or("nothing")
    }

    fn is_right(&self) -> bool {
        self.answered() == self.class
    }

    fn is_none_of_these(&self) -> bool {
        verdict::kind(&self.value) == verdict::Kind::NoneOfThese
    }
}

/// The demo's last line.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Kinds of creatures.
    pub classes: usize,
    /// Poses of each.
    pub poses: usize,
    /// Poses of each that trained.
    pub training_poses: usize,
    /// Poses that were queried, none of which trained.
    pub queries: usize,
    /// Queries answered with the right class.
    pub correct: usize,
    /// Share of queries answered with the right class, 0 to 1.
    pub top1: f64,
    /// Queries believed to be of none of the known classes, whatever class is nearest.
    pub none_of_these: usize,
    /// Wrong answers.
    pub mistakes: Vec<Mistake>,
    /// Wall-clock time of the whole, in seconds.
    pub seconds: f64,
    /// Of which making the zoo.
    pub zoo_seconds: f64,
    /// Of which uploading.
    pub upload_seconds: f64,
    /// Of which learning.
    pub reindex_seconds: f64,
    /// Of which querying.
    pub query_seconds: f64,
    /// The service's address.
    pub url: String,
}

/// A wrong answer.
#[derive(Clone, Debug, Serialize)]
pub struct Mistake {
    /// The pose.
    pub name: String,
    /// Its class.
    pub class: String,
    /// The class it was taken for.
    pub answered: String,
}

impl Summary {
    /// Sums up. `steps` are the seconds of making, uploading, learning and querying.
    pub fn new(
        answers: &[Answer],
        (classes, poses, training_poses): (usize, usize, usize),
        steps: [f64; 4],
        seconds: f64,
        url: String,
    ) -> Self {
        let mistakes: Vec<Mistake> = answers
            .iter()
            .filter(|a| !a.is_right())
            .map(|a| Mistake {
                name: a.name.clone(),
                class: a.class.clone(),
                answered: a.answered().to_owned(),
            })
            .collect();
        let correct = answers.len() - mistakes.len();
        let [zoo_seconds, upload_seconds, reindex_seconds, query_seconds] = steps;
        Self {
            classes,
            poses,
            training_poses,
            queries: answers.len(),
            correct,
            none_of_these: answers.iter().filter(|a| a.is_none_of_these()).count(),
            top1: correct as f64 / answers.len().max(1) as f64,
            mistakes,
            seconds,
            zoo_seconds,
            upload_seconds,
            reindex_seconds,
            query_seconds,
            url,
        }
    }

    /// A few ranked answers and the sum, for people.
    pub fn text(&self, answers: &[Answer]) -> String {
        let mut text = String::new();
        for answer in answers
            .iter()
            .step_by((answers.len() / EXAMPLES).max(1))
            .take(EXAMPLES)
        {
            let mut value = answer.value.clone();
            if let Some(classes) = value["classes"].as_array_mut() {
                classes.truncate(EXAMPLE_CLASSES);
            }
            text += &query_text::text(Path::new(&answer.name), &value);
            text += "\n\n";
        }
        if self.mistakes.is_empty() {
            text += "No pose was taken for another class.\n";
        } else {
            let rows: Vec<Vec<String>> = self
                .mistakes
                .iter()
                .map(|m| vec![m.name.clone(), m.class.clone(), m.answered.clone()])
                .collect();
            text += &output::table(&["mistaken pose", "class", "answered"], &rows);
            text += "\n";
        }
        if self.none_of_these > 0 {
            text += &format!(
                "{} poses were believed to be of none of the known classes\n",
                self.none_of_these
            );
        }
        text += &format!(
            "{} classes learnt from {} poses each; {} of {} unseen poses recognised ({:.1} %) in {:.1} s\n",
            self.classes,
            self.training_poses,
            self.correct,
            self.queries,
            100.0 * self.top1,
            self.seconds
        );
        text += &format!(
            "(zoo {:.1} s, upload {:.1} s, learning {:.1} s, queries {:.1} s)",
            self.zoo_seconds, self.upload_seconds, self.reindex_seconds, self.query_seconds
        );
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn mistakes_are_counted_and_named() {
        let answer = |class: &str, answered: &str| {
            Answer::new(
                class,
                &format!("{class}-08.obj"),
                json!({"classes": [{"class": {"name": answered}}]}),
            )
        };
        let answers = [answer("cat", "cat"), answer("dog", "wolf"), answer("cow", "cow")];
        let summary = Summary::new(&answers, (3, 2, 1), [0.0; 4], 1.0, String::new());
        assert_eq!((summary.queries, summary.correct), (3, 2));
        assert!((summary.top1 - 2.0 / 3.0).abs() < 1e-15);
        assert_eq!(summary.mistakes[0].answered, "wolf");
        assert!(summary.text(&answers).contains("dog-08.obj"));
    }
}
