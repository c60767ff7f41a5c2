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
            // The error of another value would repeat it, however long it is.
            Some(raw) if !raw.get().starts_with('[') => {
                return Err(format!("its list of {name}s is no list"));
            }
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
    shortened(&text[..end])
}

/// Longest text of a file that a message or a label repeats, in characters.
const MAX_SHOWN: usize = 200;

/// The beginning of a text of the file.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
