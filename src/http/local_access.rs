//! The local token: as long as there is no API key, the owner of the data directory proves to be it by a secret in a file
//! that other users cannot read. The address of the service stands beside it.
//!
//! A user that reads the data directory is trusted with everything in it; a page in a browser cannot read it. The token is new at
//! each start, so that the file in a copy of the directory opens nothing, and the file goes when the service stops.

use super::keyring::new_secret;
use crate::model::KeyHash;
use rand::rand_core::OsError;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::Path;
use subtle::ConstantTimeEq;

/// The file's name in the data directory.
pub const FILE: &str = "local-access.json";
/// What every token begins with.
const TOKEN_PREFIX: &str = "slt_";

/// How to reach the service that runs on a data directory.
#[derive(Clone, Serialize, Deserialize)]
pub struct LocalAccess {
    /// Its address, such as `http://127.0.0.1:7345`.
    pub url: String,
    /// The token it accepts, as `Authorization: Bearer …`.
    pub token: String,
}

/// The token of one run of the service.
pub struct LocalToken {
    secret: String,
    hash: KeyHash,
}

impl LocalToken {
    /// A new token of 256 random bits.
    ///
    /// # Errors
    /// Where the system has no randomness.
    pub fn new() -> Result<Self, OsError> {
        let secret = new_secret(TOKEN_PREFIX)?;
        let hash = KeyHash::of(&secret);
        Ok(Self { secret, hash })
    }

    /// The token itself.
    pub fn secret(&self) -> &str {
        &self.secret
    }

    /// Whether a request brought this token. Takes the same time wherever the two differ.
    pub fn is(&self, presented: &str) -> bool {
        KeyHash::of(presented)
            .to_bytes()
            .ct_eq(&self.hash.to_bytes())
            .into()
    }

    /// Writes the file, readable by its owner only, in place of one that an earlier run left.
    ///
    /// # Errors
    /// A failure of the file system.
    pub fn publish(&self, data: &Path, url: String) -> std::io::Result<()> {
        let access = LocalAccess {
            url,
            token: self.secret.clone(),
        };
        // A temporary file is its owner's alone from the beginning, whatever the umask.
        let mut file = tempfile::Builder::new().prefix(".writing-").tempfile_in(data)?;
        file.write_all(&serde_json::to_vec(&access)?)?;
        file.persist(data.join(FILE)).map_err(|error| error.error)?;
        Ok(())
    }
}

impl LocalAccess {
    /// What the service that runs on a data directory has written; `None` where none did, or the file is another user's.
    pub fn read(data: &Path) -> Option<Self> {
        let text = std::fs::read(data.join(FILE)).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Takes the file away.
    ///
    /// # Errors
    /// A failure of the file system.
    pub fn remove(data: &Path) -> std::io::Result<()> {
        match std::fs::remove_file(data.join(FILE)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

/// The address by which this machine reaches a service that listens there.
pub fn local_url(listening: SocketAddr, encrypted: bool) -> String {
    let scheme = if encrypted { "https" } else { "http" };
    let ip = match listening.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    format!("{scheme}://{}", SocketAddr::new(ip, listening.port()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_has_the_token_and_is_its_owners_alone() {
        let directory = tempfile::tempdir().unwrap();
        let (old, token) = (LocalToken::new().unwrap(), LocalToken::new().unwrap());
        old.publish(directory.path(), "http://127.0.0.1:1".to_owned())
            .unwrap();
        token
            .publish(directory.path(), "http://127.0.0.1:2".to_owned())
            .unwrap();
        let access = LocalAccess::read(directory.path()).unwrap();
        assert!(token.is(&access.token) && !old.is(&access.token) && !token.is(""));
        assert_eq!(access.url, "http://127.0.0.1:2");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(directory.path().join(FILE))
                .unwrap()
                .permissions()
                .mode();
            assert_eq!(mode & 0o777, 0o600);
        }
        LocalAccess::remove(directory.path()).unwrap();
        LocalAccess::remove(directory.path()).unwrap();
        assert!(LocalAccess::read(directory.path()).is_none());
    }

    #[test]
    fn a_wildcard_address_is_reached_by_loopback() {
        assert_eq!(
            local_url("0.0.0.0:7".parse().unwrap(), false),
            "http://127.0.0.1:7"
        );
        assert_eq!(local_url("[::]:7".parse().unwrap(), true), "https://[::1]:7");
        assert_eq!(
            local_url("10.0.0.5:7".parse().unwrap(), false),
            "http://10.0.0.5:7"
        );
    }
}
