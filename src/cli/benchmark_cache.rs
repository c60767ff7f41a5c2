//! What a benchmark need not compute again: descriptions of meshes and outcomes of units, kept by content.
//!
//! An entry's name is the BLAKE3 digest of everything that went into it: the deformed meshes, the parameters, and the
//! program itself. Its contents begin with their own digest, so an entry that was cut short or changed is seen and
//! computed again. Nothing is lost with the folder but time.

use super::CliError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use shapelex_core::mesh::TriangleSoup;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Bytes of the digest before the contents.
const DIGEST: usize = 32;
/// Entries of other builds of this program are removed when they have not been used for this long.
const UNUSED: Duration = Duration::from_secs(7 * 24 * 3600);
/// The file whose time says when a build's entries were used last.
const STAMP: &str = "used";

/// A folder of entries, or none.
pub struct Cache {
    folder: Option<PathBuf>,
}

impl Cache {
    /// Keeps nothing.
    pub fn none() -> Self {
        Self { folder: None }
    }

    /// Opens `dir`, or `shapelex/benchmark` in the user's cache directory; keeps nothing where there is none.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the folder cannot be made.
    pub fn open(dir: Option<&Path>) -> Result<Self, CliError> {
        let Some(root) = dir.map(Path::to_owned).or_else(users_folder) else {
            return Ok(Self::none());
        };
        let folder = root.join(program());
        std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(folder.join(STAMP), ""))
            .map_err(|error| CliError::at(&folder, format!("the cache cannot be written: {error}")))?;
        remove_unused(&root);
        Ok(Self { folder: Some(folder) })
    }

    /// The entry of that key, if there is a sound one.
    pub fn get<T: DeserializeOwned>(&self, key: &Key) -> Option<T> {
        let bytes = std::fs::read(self.path(key)?).ok()?;
        let (digest, contents) = bytes.split_at_checked(DIGEST)?;
        if blake3::hash(contents).as_bytes() != digest {
            return None;
        }
        postcard::from_bytes(contents).ok()
    }

    /// Keeps an entry. It is written beside its place and moved there, so others see the whole of it or nothing. A
    /// cache that cannot be written only costs time, so that is no error.
    pub fn put<T: Serialize>(&self, key: &Key, value: &T) {
        let Some(path) = self.path(key) else { return };
        let Ok(contents) = postcard::to_stdvec(value) else {
            return;
        };
        let write = || -> std::io::Result<()> {
            let folder = path.parent().unwrap_or(Path::new(""));
            std::fs::create_dir_all(folder)?;
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            file.write_all(blake3::hash(&contents).as_bytes())?;
            file.write_all(&contents)?;
            file.persist(&path)?;
            Ok(())
        };
        if let Err(error) = write() {
            tracing::warn!(path = %path.display(), %error, "an entry of the cache could not be written");
        }
    }

    fn path(&self, key: &Key) -> Option<PathBuf> {
        let name = key.0.to_hex();
        Some(self.folder.as_ref()?.join(&name[..2]).join(&name[2..]))
    }
}

/// An entry's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(blake3::Hash);

impl Key {
    /// The digest of a mesh.
    pub fn of_mesh(mesh: &TriangleSoup) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(mesh.vertices.len() as u64).to_le_bytes());
        for x in mesh.vertices.iter().flatten() {
            hasher.update(&x.to_le_bytes());
        }
        for v in mesh.faces.iter().flatten() {
            hasher.update(&v.to_le_bytes());
        }
        Self(hasher.finalize())
    }

    /// Begins the digest of an entry of some kind.
    pub fn builder(kind: &str) -> KeyBuilder {
        let mut builder = KeyBuilder(blake3::Hasher::new());
        builder.text(kind);
        builder
    }
}

/// A key being put together; every part is delimited, so no two lists of parts run together.
#[derive(Clone)]
pub struct KeyBuilder(blake3::Hasher);

impl KeyBuilder {
    /// Adds a text.
    pub fn text(&mut self, text: &str) {
        self.number(text.len() as u64);
        self.0.update(text.as_bytes());
    }

    /// Adds a number.
    pub fn number(&mut self, number: u64) {
        self.0.update(&number.to_le_bytes());
    }

    /// Adds another key.
    pub fn digest(mut self, key: &Key) -> Self {
        self.0.update(key.0.as_bytes());
        self
    }

    /// Adds a last key and ends.
    pub fn key(self, key: &Key) -> Key {
        self.digest(key).end()
    }

    /// Ends.
    pub fn end(self) -> Key {
        Key(self.0.finalize())
    }
}

/// `XDG_CACHE_HOME`, `~/.cache` or `%LOCALAPPDATA%`, and our folder in it.
fn users_folder() -> Option<PathBuf> {
    let set = |name: &str| {
        std::env::var_os(name)
            .filter(|v| !v.is_empty())
            .map(PathBuf::from)
    };
    set("XDG_CACHE_HOME")
        .or_else(|| Some(set("HOME")?.join(".cache")))
        .or_else(|| set("LOCALAPPDATA"))
        .map(|root| root.join("shapelex").join("benchmark"))
}

/// A name for this build of the program: what another one computed may differ.
fn program() -> String {
    let digest = std::env::current_exe()
        .ok()
        .and_then(|path| std::fs::read(path).ok())
        .map(|bytes| blake3::hash(&bytes).to_hex()[..16].to_owned());
    format!(
        "{}-{}",
        env!("CARGO_PKG_VERSION"),
        digest.as_deref().unwrap_or("unknown")
    )
}

/// Removes the entries of builds that have not been used for long.
fn remove_unused(root: &Path) {
    let Ok(entries) = std::fs::read_dir(root) else {
        return;
    };
    for folder in entries.flatten().map(|e| e.path()) {
        let used = std::fs::metadata(folder.join(STAMP)).and_then(|m| m.modified());
        let old = |time: SystemTime| time.elapsed().is_ok_and(|age| age > UNUSED);
        // Only folders with our stamp are ours.
        if used.is_ok_and(old) {
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_back_and_damaged_ones_do_not() {
        let dir = tempfile::tempdir().unwrap();
        let cache = Cache::open(Some(dir.path())).unwrap();
        let key = Key::builder("test").end();
        assert_eq!(cache.get::<Vec<f32>>(&key), None);
        let value = vec![1.5f32; 100];
        cache.put(&key, &value);
        assert_eq!(cache.get::<Vec<f32>>(&key), Some(value));
        let path = cache.path(&key).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[200] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(cache.get::<Vec<f32>>(&key), None, "changed");
        std::fs::write(&path, &bytes[..20]).unwrap();
        assert_eq!(cache.get::<Vec<f32>>(&key), None, "cut short");
        Cache::none().put(&key, &1u8);
        assert_eq!(Cache::none().get::<u8>(&key), None);
    }

    #[test]
    fn parts_of_a_key_do_not_run_together() {
        let key = |parts: &[&str]| {
            let mut builder = Key::builder("test");
            parts.iter().for_each(|p| builder.text(p));
            builder.end()
        };
        assert_ne!(key(&["ab", "c"]), key(&["a", "bc"]));
        assert_eq!(key(&["ab"]), key(&["ab"]));
    }
}
