//! What an answer says, in words.

use super::listing::cell;
use serde_json::Value;

/// How an answer is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// It names a class.
    Class,
    /// The query belongs to none of the known classes.
    NoneOfThese,
}

/// An answer's best class, empty where it names none.
pub fn best(answer: &Value) -> String {
    cell(&answer["classes"][0], "class.name")
}

/// How an answer is to be taken.
pub fn kind(answer: &Value) -> Kind {
    let said = answer["verdict"]["kind"].as_str();
    let refused = answer["none_of_these"].as_bool() == Some(true);
    if said == Some("none_of_these") || (said.is_none() && refused) {
        Kind::NoneOfThese
    } else {
        Kind::Class
    }
}

/// One sentence: the service's own, or one made of what the answer has.
pub fn sentence(answer: &Value) -> String {
    if let Some(text) = answer["verdict"]["text"].as_str() {
        return text.to_owned();
    }
    let best = best(answer);
    let possible: Vec<String> = answer["possible_classes"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|class| cell(class, "name"))
        .collect();
    match (answer["none_of_these"].as_bool(), possible.as_slice()) {
        (Some(true), _) => format!("none of the known classes; nearest: {best}"),
        (Some(false), [one]) => one.clone(),
        (Some(false), [_, ..]) => format!("one of {}", possible.join(", ")),
        _ => format!("nearest: {best}; whether it is of a known class cannot be told"),
    }
}

/// A p-value as what it counts: training shapes that fit their own class no better.
pub fn typicality(p: f64) -> String {
    format!("{:.0} of 100", (100.0 * p).round().max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn answers_are_said_in_words_with_and_without_the_services_own() {
        let answer = |none: Value, possible: &[&str]| {
            let possible: Vec<Value> = possible.iter().map(|name| json!({ "name": name })).collect();
            json!({
                "classes": [{ "class": { "name": "michael" } }],
                "none_of_these": none,
                "possible_classes": possible,
            })
        };
        let none = answer(json!(true), &[]);
        assert_eq!(sentence(&none), "none of the known classes; nearest: michael");
        assert_eq!(kind(&none), Kind::NoneOfThese);
        assert_eq!(sentence(&answer(json!(false), &["michael"])), "michael");
        assert_eq!(
            sentence(&answer(json!(false), &["michael", "david"])),
            "one of michael, david"
        );
        let unknown = answer(Value::Null, &[]);
        assert!(sentence(&unknown).starts_with("nearest: michael;"));
        assert_eq!(kind(&unknown), Kind::Class);
        let mut own = none;
        own["verdict"] = json!({ "text": "perhaps a cat", "kind": "class" });
        assert_eq!(sentence(&own), "perhaps a cat");
        assert_eq!(kind(&own), Kind::Class);
    }
}
