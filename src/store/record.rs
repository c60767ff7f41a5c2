//! The envelope of every record: what it is, which version, how long, and a checksum.
//!
//! ```text
//! offset  0  3 bytes   "SLX"
//!         3  u8        record family
//!         4  u16       version of the family's payload
//!         6  u32       length of the payload
//!        10  u32       CRC-32 (IEEE) of key ‖ bytes 3..10 ‖ payload
//!        14            payload
//! ```
//!
//! Numbers are little-endian on every machine. The key is part of the checksum, so a value that ended up under
//! another key is found out. The payload is postcard; postcard does not describe itself, so a family that changes
//! gets a new version number and a decoder per version.

use super::StoreError;

const MAGIC: &[u8; 3] = b"SLX";
const HEADER: usize = 14;

/// Which kind of record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Family {
    /// A single value of the store itself.
    Meta = 1,
    /// A class.
    Class = 2,
    /// Class name → class.
    Name = 3,
    /// A shape.
    Shape = 4,
    /// Shape → class.
    Owner = 5,
    /// Contents and pose within a class → shape.
    Identity = 6,
    /// A stored file is used by a shape.
    Reference = 7,
    /// The dictionaries of a class or shape.
    Dictionary = 8,
    /// A generation of the index.
    Generation = 9,
    /// A job.
    Job = 10,
    /// A job that is not finished.
    Queue = 11,
    /// A shape's signatures, in a file of their own.
    Signatures = 12,
    /// An API key.
    ApiKey = 13,
    /// What the baselines' descriptors of a generation share.
    BaselineModel = 15,
    /// The baselines' descriptors of a class's shapes.
    Baselines = 16,
}

/// A value with a family, a version and an encoding.
pub trait Record: Sized {
    /// Its family.
    const FAMILY: Family;
    /// The version written.
    const VERSION: u16;
    /// The payload.
    ///
    /// # Errors
    /// A sentence where the value cannot be encoded.
    fn encode(&self) -> Result<Vec<u8>, String>;
    /// The value of a payload of the given version.
    ///
    /// # Errors
    /// A sentence where the payload is not one of that version.
    fn decode(version: u16, payload: &[u8]) -> Result<Self, String>;
}

fn checksum(key: &[u8], head: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(key);
    hasher.update(head);
    hasher.update(payload);
    hasher.finalize()
}

/// Wraps a record into its envelope.
///
/// # Errors
/// [`StoreError::Io`] where it cannot be encoded or is longer than 4 GiB.
pub fn seal<R: Record>(key: &[u8], record: &R) -> Result<Vec<u8>, StoreError> {
    let fail = |detail: String| StoreError::Io {
        what: format!("encode {}", describe(key)),
        detail,
    };
    let payload = record.encode().map_err(fail)?;
    let length = u32::try_from(payload.len()).map_err(|_| fail("longer than 4 GiB".to_owned()))?;
    let mut bytes = Vec::with_capacity(HEADER + payload.len());
    bytes.extend_from_slice(MAGIC);
    bytes.push(R::FAMILY as u8);
    bytes.extend_from_slice(&R::VERSION.to_le_bytes());
    bytes.extend_from_slice(&length.to_le_bytes());
    let crc = checksum(key, &bytes[3..10], &payload);
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes.extend_from_slice(&payload);
    Ok(bytes)
}

/// Checks an envelope and decodes what is in it.
///
/// # Errors
/// [`StoreError::Damaged`] where anything is not what [`seal`] wrote.
pub fn unseal<R: Record>(key: &[u8], bytes: &[u8]) -> Result<R, StoreError> {
    let damaged = |detail: String| StoreError::damaged(describe(key), detail);
    let (family, version, payload) = check(key, bytes)?;
    if family != R::FAMILY as u8 {
        return Err(damaged(format!(
            "record family {family} where {} belongs",
            R::FAMILY as u8
        )));
    }
    R::decode(version, payload).map_err(damaged)
}

/// Checks an envelope without decoding: family, version, payload.
///
/// # Errors
/// [`StoreError::Damaged`] naming the first thing that is wrong.
pub fn check<'a>(key: &[u8], bytes: &'a [u8]) -> Result<(u8, u16, &'a [u8]), StoreError> {
    let damaged = |detail: String| StoreError::damaged(describe(key), detail);
    let Some((head, payload)) = bytes.split_at_checked(HEADER) else {
        return Err(damaged(format!("{} bytes, too short for a record", bytes.len())));
    };
    if &head[..3] != MAGIC {
        return Err(damaged("it does not begin as a record does".to_owned()));
    }
    let length = u32::from_le_bytes([head[6], head[7], head[8], head[9]]);
    if u32::try_from(payload.len()) != Ok(length) {
        return Err(damaged(format!(
            "{} bytes of payload where {length} belong",
            payload.len()
        )));
    }
    let written = u32::from_le_bytes([head[10], head[11], head[12], head[13]]);
    let found = checksum(key, &head[3..10], payload);
    if written != found {
        return Err(damaged(format!(
            "checksum {found:08x} where {written:08x} belongs"
        )));
    }
    Ok((head[3], u16::from_le_bytes([head[4], head[5]]), payload))
}

/// A key as people can read it: `class/0190…`.
pub(super) fn describe(key: &[u8]) -> String {
    let cut = key.iter().position(|&b| b == b'/').map_or(key.len(), |p| p + 1);
    let (family, rest) = key.split_at(cut);
    let mut text = String::from("record ");
    text.push_str(&String::from_utf8_lossy(family));
    if rest.iter().all(u8::is_ascii_graphic) {
        text.push_str(&String::from_utf8_lossy(rest));
    } else {
        for byte in rest {
            text.push_str(&format!("{byte:02x}"));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Text(String);

    impl Record for Text {
        const FAMILY: Family = Family::Meta;
        const VERSION: u16 = 3;
        fn encode(&self) -> Result<Vec<u8>, String> {
            Ok(self.0.clone().into_bytes())
        }
        fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
            assert_eq!(version, 3);
            String::from_utf8(payload.to_vec())
                .map(Self)
                .map_err(|e| e.to_string())
        }
    }

    #[test]
    fn a_record_survives_its_envelope() {
        let bytes = seal(b"meta/x", &Text("twelve".into())).unwrap();
        assert_eq!(unseal::<Text>(b"meta/x", &bytes).unwrap().0, "twelve");
    }

    #[test]
    fn every_changed_bit_every_cut_and_a_wrong_key_is_found() {
        let bytes = seal(b"meta/x", &Text("twelve classes".into())).unwrap();
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bad = bytes.clone();
                bad[at] ^= 1 << bit;
                assert!(check(b"meta/x", &bad).is_err(), "byte {at}, bit {bit}");
            }
            assert!(check(b"meta/x", &bytes[..at]).is_err(), "cut at {at}");
        }
        assert!(check(b"meta/y", &bytes).is_err());
    }
}
