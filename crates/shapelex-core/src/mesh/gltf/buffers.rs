//! The buffers of a document, and what was unpacked of them. Nothing is ever opened: a buffer is in the file or came
//! with it.

use super::list::List;
use super::uri::{BufferFiles, BufferUri};
use crate::memory::Held;
use crate::mesh::{Companion, MeshError, ReadContext, Source};
use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeSet;

/// Bytes that were unpacked, and the memory that is reserved for them.
pub(super) struct Unpacked<'d> {
    pub bytes: Vec<u8>,
    pub _memory: Held<'d>,
}

/// The buffers of a document, loaded when they are needed.
pub(super) struct Buffers<'d> {
    pub list: List<'d>,
    pub binary: Option<&'d [u8]>,
    pub source: Source<'d>,
    /// The names of the files that came along.
    files: OnceCell<BufferFiles>,
    context: &'d ReadContext,
    pub loaded: Vec<OnceCell<Loaded<'d>>>,
    /// Views that were decompressed.
    pub views: Vec<OnceCell<Box<Unpacked<'d>>>>,
    /// Files that came along and are counted already, by address: a file that many URIs mean counts once.
    counted: RefCell<BTreeSet<usize>>,
    /// Bytes of the file and of those that came along and are referred to.
    taken: Cell<usize>,
    /// Bytes that were unpacked from text or decompressed.
    unpacked: Cell<usize>,
}

/// A buffer's contents.
pub(super) enum Loaded<'d> {
    There(&'d [u8]),
    Unpacked(Box<Unpacked<'d>>),
}

impl Loaded<'_> {
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::There(bytes) => bytes,
            Self::Unpacked(unpacked) => &unpacked.bytes,
        }
    }
}

impl<'d> Buffers<'d> {
    pub fn new(
        views: usize,
        list: List<'d>,
        binary: Option<&'d [u8]>,
        source: &Source<'d>,
        context: &'d ReadContext,
    ) -> Self {
        Self {
            loaded: (0..list.len()).map(|_| OnceCell::new()).collect(),
            list,
            binary,
            source: *source,
            files: OnceCell::new(),
            context,
            views: (0..views).map(|_| OnceCell::new()).collect(),
            counted: RefCell::default(),
            taken: Cell::new(source.bytes.len()),
            unpacked: Cell::new(0),
        }
    }

    /// The file that came along under this name.
    pub fn file(&self, uri: &BufferUri) -> Option<&'d [u8]> {
        let companions = self.source.companions;
        let names = || companions.iter().map(|companion| (companion.name.as_str(), true));
        let files = self.files.get_or_init(|| BufferFiles::new(names()));
        companions.get(files.find("", uri)?).map(Companion::bytes)
    }

    /// Counts a file that came along, once however many URIs mean it.
    pub fn count_file(&self, bytes: &[u8]) -> Result<(), MeshError> {
        if self.counted.borrow_mut().insert(bytes.as_ptr() as usize) {
            self.taken.set(self.taken.get().saturating_add(bytes.len()));
        }
        self.context.limits.check_bytes(self.taken.get())
    }

    /// Most bytes that one document may unpack, of all its buffers and views together: the positions, indices, joints
    /// and weights of the largest mesh take less.
    fn unpacked_limit(&self) -> usize {
        self.context.limits.max_bytes / 8 * 3
    }

    /// Counts bytes about to be unpacked and reserves memory for them.
    pub fn reserve_unpacked(&self, bytes: usize) -> Result<Held<'d>, MeshError> {
        let (unpacked, limit) = (self.unpacked.get().saturating_add(bytes), self.unpacked_limit());
        if unpacked > limit {
            return Err(MeshError::TooLarge {
                what: "bytes in its embedded and compressed buffers",
                found: unpacked,
                limit,
            });
        }
        self.unpacked.set(unpacked);
        Ok(self.context.memory.hold(bytes as u64)?)
    }
}
