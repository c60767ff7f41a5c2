//! An uploaded archive → its files.

use shapelex::http::archive::{ArchiveLimits, detect, unpack};

const LIMITS: ArchiveLimits = ArchiveLimits {
    max_members: 20,
    max_bytes: 100_000,
};

/// Unpacks; what comes out is within the limits and stays inside.
pub fn check(bytes: &[u8]) {
    let Some(kind) = detect(bytes) else { return };
    let Ok(members) = unpack(kind, bytes, &LIMITS) else {
        return;
    };
    assert!(members.len() <= LIMITS.max_members);
    assert!(members.iter().map(|m| m.bytes.len()).sum::<usize>() <= LIMITS.max_bytes);
    for member in members {
        let path = member.path;
        assert!(
            !path.is_empty() && !path.starts_with('/') && !path.contains('\\'),
            "{path:?}"
        );
        assert!(
            path.split('/').all(|part| !matches!(part, "" | "." | "..")),
            "{path:?}"
        );
        assert!(!path.chars().any(char::is_control), "{path:?}");
    }
}
