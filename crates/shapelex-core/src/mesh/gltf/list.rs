//! A list of the document, its elements still text.

use serde_json::value::RawValue;

/// A list of the document.
pub(super) struct List<'t> {
    name: &'static str,
    elements: Vec<&'t RawValue>,
}

impl<'t> List<'t> {
    /// A list whose elements are called `name` in messages; empty where there is none. The error says what is wrong.
    pub fn parse(name: &'static str, raw: Option<&'t RawValue>) -> Result<Self, String> {
        let elements = match raw {
            Some(raw) => {
                serde_json::from_str(raw.get()).map_err(|e| format!("its list of {name}s: {}", reason(&e)))?
            }
            None => Vec::new(),
        };
        Ok(Self { name, elements })
    }

    /// What an element is called in messages.
    pub fn name(&self) -> &'static str {
        self.name
    }

    pub fn len(&self) -> usize {
        self.elements.len()
    }

    pub fn elements(&self) -> &[&'t RawValue] {
        &self.elements
    }

    pub fn into_elements(self) -> Vec<&'t RawValue> {
        self.elements
    }
}

/// What is wrong with an element, without the position in a text that the caller does not see.
pub(super) fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let end = text.rfind(" at line ").unwrap_or(text.len());
    text[..end].to_owned()
}
