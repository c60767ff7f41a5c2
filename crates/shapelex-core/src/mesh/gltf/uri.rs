//! What a buffer's URI means: bytes inside the document, or a file beside it.
//!
//! This is the one place where the names of external buffers are read; the command line, multipart requests and
//! archives look for files by what [`external_buffers`] lists, and the reader finds them by the same rules.

use super::container::{BYTE_ORDER_MARK, Container};
use super::schema::{Buffer, Top, text};
use crate::memory::Reservation;
use crate::mesh::{Format, MeshError};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

/// A buffer that lies in a file of its own.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BufferUri {
    /// The path relative to the document: percent-decoded, with forward slashes and without `.` segments.
    path: String,
    /// The same without percent-decoding, for files whose names have a `%`.
    literal: String,
}

impl BufferUri {
    /// Reads a URI; `None` where the bytes are in the URI itself.
    pub fn parse(uri: &str) -> Option<Self> {
        if data(uri).is_some() {
            return None;
        }
        let decoded = String::from_utf8_lossy(&percent_decode(uri.as_bytes())).into_owned();
        Some(Self {
            path: plain(&decoded),
            literal: plain(uri),
        })
    }

    /// The path to look at first, and the name the file is known by.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Relative paths to look at, in order, none of which leaves the document's folder: the decoded path, the path as
    /// it is written, and the file's name alone, which is where an absolute path or one that climbs out ends up.
    pub fn candidates(&self) -> impl Iterator<Item = &str> {
        let inside = |path: &&str| !path.is_empty() && !path.split('/').any(|s| s == "..");
        [self.path.as_str(), self.literal.as_str()]
            .into_iter()
            .filter(inside)
            .chain(std::iter::once(last(&self.path)))
            .filter(inside)
    }
}

/// The names of files that came along, so that many buffers are found among many files in time.
#[derive(Clone, Debug, Default)]
pub struct BufferFiles {
    /// By the name as it is and by its path in plain spelling; the first file of a name counts.
    places: HashMap<String, usize>,
    /// By the last part alone.
    last_parts: HashMap<String, usize>,
}

impl BufferFiles {
    /// The files of these names, in their order, and whether a file is found by the last part of its name alone.
    pub fn new<'n>(names: impl IntoIterator<Item = (&'n str, bool)>) -> Self {
        let mut files = Self::default();
        for (i, (name, by_last_part)) in names.into_iter().enumerate() {
            let place = plain(name);
            if by_last_part {
                files.last_parts.entry(last(&place).to_owned()).or_insert(i);
            }
            files.places.entry(place).or_insert(i);
            files.places.entry(name.to_owned()).or_insert(i);
        }
        files
    }

    /// Which file a buffer is: first by the path from `folder`, in which the document lies, then by its last part.
    pub fn find(&self, folder: &str, uri: &BufferUri) -> Option<usize> {
        let at = |path: &str| {
            let beside = self.places.get(&plain(&format!("{folder}/{path}")));
            beside.into_iter().chain(self.places.get(path)).min()
        };
        at(&uri.path)
            .or_else(|| at(&uri.literal))
            .or_else(|| self.last_parts.get(last(&uri.path)))
            .copied()
    }
}

/// The files a glTF document refers to, each once, in the order of their paths; none where the bytes are no glTF. Memory is
/// reserved in `memory` while the document is read.
///
/// # Errors
/// [`MeshError::Memory`].
pub fn external_buffers(bytes: &[u8], memory: &Reservation) -> Result<Vec<BufferUri>, MeshError> {
    let document = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let format = if bytes.starts_with(b"glTF") {
        Format::Glb
    } else if document.trim_ascii_start().starts_with(b"{") {
        Format::Gltf
    } else {
        return Ok(Vec::new());
    };
    let mut _copy = None;
    let container = Container::open(bytes, format, |bytes| {
        _copy = Some(memory.hold(bytes as u64)?);
        Ok(())
    });
    // Whether the document is fit to be read at all is for the reader to say.
    let container = match container {
        Ok(container) => container,
        Err(error @ MeshError::Memory(_)) => return Err(error),
        Err(_) => return Ok(Vec::new()),
    };
    let Ok(bytes) = container.check_counts() else {
        return Ok(Vec::new());
    };
    let _lists = memory.hold(bytes)?;
    let top: Top<'_> = serde_json::from_str(&container.json).unwrap_or_default();
    let list = top.buffers.map(RawValue::get).unwrap_or("[]");
    let buffers: Vec<&RawValue> = serde_json::from_str(list).unwrap_or_default();
    let found: BTreeMap<String, BufferUri> = buffers
        .into_iter()
        .filter_map(|raw| serde_json::from_str::<Buffer<'_>>(raw.get()).ok()?.uri)
        .filter_map(text)
        .filter_map(|uri| BufferUri::parse(&uri))
        .map(|uri| (uri.path.clone(), uri))
        .collect();
    Ok(found.into_values().collect())
}

/// What follows `data:`, in any case.
pub(super) fn data(uri: &str) -> Option<&str> {
    let scheme = uri.get(..5)?;
    scheme.eq_ignore_ascii_case("data:").then(|| &uri[5..])
}

fn last(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// Forward slashes, without `.` and empty segments, and without `..` as far as there is a segment before it. An
/// absolute path, a drive letter or a scheme leaves the last part alone: what lies elsewhere is never looked for.
fn plain(path: &str) -> String {
    let path = path.replace('\\', "/");
    let scheme = path
        .split_once(':')
        .is_some_and(|(head, _)| !head.is_empty() && head.bytes().all(|b| b.is_ascii_alphanumeric()));
    let path = if scheme { last(&path) } else { path.as_str() };
    let mut segments: Vec<&str> = Vec::new();
    for segment in path.split('/') {
        match segment {
            "" | "." => {}
            ".." if segments.last().is_some_and(|s| *s != "..") => {
                segments.pop();
            }
            other => segments.push(other),
        }
    }
    segments.join("/")
}

/// `%20` → a blank, and so on; a `%` without two hexadecimal digits stays as it is.
pub(super) fn percent_decode(text: &[u8]) -> Cow<'_, [u8]> {
    if !text.contains(&b'%') {
        return Cow::Borrowed(text);
    }
    let mut decoded = Vec::with_capacity(text.len());
    let mut k = 0;
    while k < text.len() {
        let hex = |at: usize| text.get(at).and_then(|&b| (b as char).to_digit(16));
        match (text[k], hex(k + 1), hex(k + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                k += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                k += 1;
            }
        }
    }
    decoded.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::MemoryBudget;

    fn candidates(uri: &str) -> Vec<String> {
        let uri = BufferUri::parse(uri).expect("a file");
        let mut list: Vec<String> = uri.candidates().map(str::to_owned).collect();
        list.dedup();
        list
    }

    #[test]
    fn many_spellings_of_one_path() {
        for uri in [
            "a b.bin",
            "./a%20b.bin",
            "././a b.bin",
            ".\\a%20b.bin",
            "x/../a b.bin",
        ] {
            assert_eq!(BufferUri::parse(uri).expect("a file").path(), "a b.bin", "{uri}");
        }
        assert_eq!(candidates("parts\\m%C3%BCde.bin")[0], "parts/müde.bin");
        assert_eq!(candidates("50%25.bin"), ["50%.bin", "50%25.bin", "50%.bin"]);
        assert_eq!(BufferUri::parse("DATA:,x"), None);
    }

    #[test]
    fn what_lies_elsewhere_is_looked_for_beside_the_document() {
        for uri in [
            "/etc/passwd",
            "../../passwd",
            "..%2F..%2Fpasswd",
            "file:///etc/passwd",
            "C:\\x\\passwd",
            "http://host/passwd",
            "a/../../passwd",
        ] {
            let paths = candidates(uri);
            assert!(
                !paths.is_empty() && !paths.iter().any(|p| p.starts_with('/')),
                "{uri}: {paths:?}"
            );
            assert!(
                !paths.iter().any(|p| p.split('/').any(|s| s == "..")),
                "{uri}: {paths:?}"
            );
            assert_eq!(paths.last().map(String::as_str), Some("passwd"), "{uri}");
        }
        assert!(candidates("..").is_empty());
    }

    #[test]
    fn a_file_is_found_from_its_folder_first() {
        let files = ["one/b.bin", "two/b.bin", "shared/c.bin", "b.bin"];
        let index = BufferFiles::new(files.iter().map(|f| (*f, !f.contains('/'))));
        let find = |uri: &str, folder: &str| {
            let uri = BufferUri::parse(uri).expect("a file");
            index.find(folder, &uri).map(|i| files[i])
        };
        assert_eq!(find("b.bin", "two"), Some("two/b.bin"));
        assert_eq!(find("./b.bin", "three"), Some("b.bin"));
        assert_eq!(find("../shared/c.bin", "two"), Some("shared/c.bin"));
        assert_eq!(find("c.bin", "two"), None);
    }

    #[test]
    fn external_buffers_are_listed_once_each() {
        let json = r#"{"buffers":[{"uri":"x.bin"},{"uri":"./x.bin"},{"uri":"data:;base64,AA=="},{},7,{"uri":"y.bin"}]}"#;
        let memory = MemoryBudget::new(4096).reservation();
        let list = external_buffers(format!("\u{feff} {json}").as_bytes(), &memory).unwrap();
        let paths: Vec<&str> = list.iter().map(BufferUri::path).collect();
        assert_eq!(paths, ["x.bin", "y.bin"]);
        assert!(external_buffers(b"v 0 0 0", &memory).unwrap().is_empty());
        assert!(external_buffers(b"{", &memory).unwrap().is_empty());
        assert_eq!(memory.bytes(), 0);
    }

    #[test]
    fn the_copy_of_a_text_that_is_no_utf_8_is_reserved() {
        let mut bytes = br#"{"buffers":[{"uri":"x.bin","name":""#.to_vec();
        bytes.resize(bytes.len() + 10_000, 0xff);
        bytes.extend(br#""}]}"#);
        let found = external_buffers(&bytes, &MemoryBudget::new(20_000).reservation()).unwrap();
        assert_eq!(found.len(), 1);
        let budget = MemoryBudget::new(5_000);
        let refused = external_buffers(&bytes, &budget.reservation());
        assert!(matches!(refused, Err(MeshError::Memory(_))), "{refused:?}");
        assert_eq!(budget.used(), 0);
    }
}
