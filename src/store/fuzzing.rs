//! The record decoders under one roof, for the fuzz target `record`.

use super::baselines::{ModelRecord, ShapesRecord};
use super::catalogue_log::LineIn;
use super::dictionaries::DictionaryRecord;
use super::idempotency::Remembered;
use super::payload::{Link, Number};
use super::record::{Record, check as check_envelope, seal, unseal};
use crate::model::{ApiKey, Class, Generation, Job, Shape};
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::Description;

/// Decodes bytes as a record: the first byte chooses the family, the second the version, the rest is the payload. The
/// same bytes are also taken for a whole envelope and for a line of the catalogue log.
///
/// # Panics
/// Where a decoder does, and where what was decoded does not survive being written and read again.
pub fn check(bytes: &[u8]) {
    let _ = check_envelope(b"meta/x", bytes);
    let _ = super::catalogue_log::parse(bytes);
    let [family, version, payload @ ..] = bytes else {
        return;
    };
    let version = u16::from(*version);
    match family % 14 {
        0 => decode::<Number>(version, payload),
        1 => decode::<Parameters>(version, payload),
        2 => decode::<Link<3>>(version, payload),
        3 => decode::<Class>(version, payload),
        4 => decode::<Shape>(version, payload),
        5 => decode::<Description>(version, payload),
        6 => decode::<DictionaryRecord>(version, payload),
        7 => decode::<Generation>(version, payload),
        8 => decode::<Job>(version, payload),
        // The text behind a line's checksum.
        9 => drop(serde_json::from_slice::<LineIn>(payload)),
        10 => decode::<ModelRecord>(version, payload),
        11 => decode::<ShapesRecord>(version, payload),
        12 => decode::<ApiKey>(version, payload),
        _ => decode::<Remembered>(version, payload),
    }
}

fn decode<R: Record>(version: u16, payload: &[u8]) {
    let Ok(record) = R::decode(version, payload) else {
        return;
    };
    // Numbers that are not finite have no JSON; the writer refuses them with a sentence.
    if let Ok(sealed) = seal(b"meta/x", &record) {
        let read: Result<R, _> = unseal(b"meta/x", &sealed);
        assert!(read.is_ok(), "a record that was written is not read again");
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn the_corpus_is_decoded_or_refused() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/record");
        let mut inputs = 0;
        for entry in std::fs::read_dir(&folder).unwrap() {
            super::check(&std::fs::read(entry.unwrap().path()).unwrap());
            inputs += 1;
        }
        assert!(inputs >= 20, "{inputs} inputs in {}", folder.display());
    }
}
