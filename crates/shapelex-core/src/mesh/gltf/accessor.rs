//! Numbers out of buffers: accessors, dense and sparse, of every component type, and attributes of Draco streams.

use super::document::Document;
use super::schema::{self, Index, Whole};
use super::work::BLOCK;
use crate::memory::Held;
use crate::mesh::MeshError;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use std::cell::Cell;

fn decode(component: ComponentType, b: &[u8]) -> f64 {
    match (component, b) {
        (ComponentType::I8, [a, ..]) => f64::from(*a as i8),
        (ComponentType::U8, [a, ..]) => f64::from(*a),
        (ComponentType::I16, [a, b, ..]) => f64::from(i16::from_le_bytes([*a, *b])),
        (ComponentType::U16, [a, b, ..]) => f64::from(u16::from_le_bytes([*a, *b])),
        (ComponentType::U32, [a, b, c, d, ..]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        (ComponentType::F32, [a, b, c, d, ..]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => 0.0,
    }
}

/// What a stored integer c of a normalised accessor stands for (glTF 2.0, 3.6.2.2; the signed form as
/// KHR_mesh_quantization has it: max(c / 127, −1)).
fn scale(component: ComponentType) -> f64 {
    match component {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32767.0,
        ComponentType::U16 => 65535.0,
        ComponentType::U32 => 4_294_967_295.0,
        ComponentType::F32 => 1.0,
    }
}

/// Elements of `size` bytes, `stride` apart, in a slice that holds as many as were checked.
struct Elements<'s> {
    bytes: &'s [u8],
    stride: usize,
    size: usize,
}

impl Elements<'_> {
    fn get(&self, k: usize) -> &[u8] {
        &self.bytes[k * self.stride..k * self.stride + self.size]
    }
}

enum Data<'s> {
    /// All zero.
    Zero,
    /// In a buffer.
    Stored(Elements<'s>),
    /// Dense numbers with the sparse ones put in.
    Merged { numbers: Vec<f64>, _kept: Kept<'s> },
    /// Decoded from a Draco stream, in the accessor's component type.
    Decoded {
        numbers: Vec<f32>,
        _kept: Option<Kept<'s>>,
    },
}

/// An accessor that was checked: every element below `count` can be read.
pub(super) struct Column<'s> {
    pub count: usize,
    components: usize,
    component: ComponentType,
    normalized: bool,
    data: Data<'s>,
}

impl<'s> Column<'s> {
    /// Numbers that a Draco stream gave for an accessor.
    pub fn decoded(
        numbers: Vec<f32>,
        kept: Option<Kept<'s>>,
        components: usize,
        accessor: (ComponentType, bool),
    ) -> Self {
        let (component, normalized) = accessor;
        Self {
            count: numbers.len() / components.max(1),
            components,
            component,
            normalized,
            data: Data::Decoded { numbers, _kept: kept },
        }
    }

    /// Numbers of an element.
    pub fn components(&self) -> usize {
        self.components
    }

    fn value(&self, c: f64) -> f64 {
        if self.normalized {
            (c / scale(self.component)).max(-1.0)
        } else {
            c
        }
    }

    /// Component `i` of element `k`.
    pub fn number(&self, k: usize, i: usize) -> f64 {
        let at = k * self.components + i;
        match &self.data {
            Data::Zero => 0.0,
            Data::Stored(elements) => {
                let width = self.component.size();
                self.value(decode(self.component, &elements.get(k)[i * width..]))
            }
            Data::Merged { numbers, .. } => numbers[at],
            Data::Decoded { numbers, .. } => self.value(f64::from(numbers[at])),
        }
    }

    /// The first `N` components of element `k`, which has at least as many.
    pub fn element<const N: usize>(&self, k: usize) -> [f64; N] {
        std::array::from_fn(|i| self.number(k, i))
    }

    /// The same as [`number`](Self::number) of a scalar, as an index.
    pub fn index(&self, k: usize) -> u32 {
        self.number(k, 0) as u32
    }
}

/// Bytes of unpacked accessors that are in memory, given back when dropped.
pub(super) struct Kept<'s> {
    bytes: usize,
    all: &'s Cell<usize>,
    _memory: Held<'s>,
}

impl Drop for Kept<'_> {
    fn drop(&mut self) {
        self.all.set(self.all.get() - self.bytes);
    }
}

impl<'d> Document<'d> {
    /// Reserves memory for an accessor that is unpacked. The accessors of all vertices of a mesh are open at the same
    /// time, so they have a limit together, by which each vertex of the largest mesh may have 48 bytes.
    pub fn keep(&self, bytes: usize, what: &'static str) -> Result<Kept<'_>, MeshError> {
        let limit = self.limits.max_vertices.saturating_mul(48);
        let found = self.unpacked.get().saturating_add(bytes);
        if found > limit {
            return Err(MeshError::TooLarge { what, found, limit });
        }
        let memory = self.context.memory.hold(bytes as u64)?;
        self.unpacked.set(found);
        Ok(Kept {
            bytes,
            all: &self.unpacked,
            _memory: memory,
        })
    }

    /// Parses an accessor.
    pub fn accessor(&self, index: Index) -> Result<schema::Accessor, MeshError> {
        self.get(&self.accessors, index.value())
    }

    /// How many elements an accessor has, by its own word.
    pub fn count(&self, accessor: &schema::Accessor) -> usize {
        usize::try_from(accessor.count.0).unwrap_or(usize::MAX)
    }

    /// The component type of an accessor whose elements are of the expected type.
    pub fn component(
        &self,
        accessor: &schema::Accessor,
        expected: Type,
        what: &str,
    ) -> Result<ComponentType, MeshError> {
        let (Checked::Valid(component), Checked::Valid(found)) = (&accessor.component_type, &accessor.kind)
        else {
            return Err(self.malformed(format!("{what}: unknown component or element type")));
        };
        if *found != expected {
            return Err(self.malformed(format!(
                "{what}: elements of type {found:?}, expected {expected:?}"
            )));
        }
        Ok(component.0)
    }

    /// Opens an accessor whose elements are of the expected type; `what` names it in messages and in
    /// [`MeshError::TooLarge`].
    pub fn column(
        &self,
        accessor: &schema::Accessor,
        expected: Type,
        what: &'static str,
    ) -> Result<Column<'_>, MeshError> {
        let component = self.component(accessor, expected, what)?;
        let count = self.count(accessor);
        // Every element takes a byte of a file at least.
        let limit = self.limits.max_bytes;
        if count > limit {
            return Err(MeshError::TooLarge {
                what,
                found: count,
                limit,
            });
        }
        let components = expected.multiplicity();
        let mut column = Column {
            count,
            components,
            component,
            normalized: accessor.normalized.unwrap_or(false),
            data: Data::Zero,
        };
        if let Some(view) = accessor.buffer_view {
            let size = components * component.size();
            let elements = self.elements(view, accessor.byte_offset, count, size, what)?;
            column.data = Data::Stored(elements);
        }
        if let Some(sparse) = &accessor.sparse {
            column.data = self.merge(&column, sparse, what)?;
        }
        Ok(column)
    }

    /// `count` elements of `size` bytes from `offset` bytes into a view, after checking that they are inside.
    fn elements(
        &self,
        view: Index,
        offset: Option<Whole>,
        count: usize,
        size: usize,
        what: &str,
    ) -> Result<Elements<'_>, MeshError> {
        let view = self.view(view.value(), what)?;
        let offset = offset.unwrap_or_default().0;
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(self.malformed(format!(
                "{what}: a stride of {stride} bytes for elements of {size}"
            )));
        }
        let needed = (count as u64)
            .saturating_sub(1)
            .saturating_mul(stride as u64)
            .saturating_add(if count > 0 { size as u64 } else { 0 })
            .saturating_add(offset);
        if needed > view.bytes.len() as u64 {
            return Err(self.truncated(format!(
                "{what}: {count} elements need {needed} bytes of a buffer view of {}",
                view.bytes.len()
            )));
        }
        Ok(Elements {
            bytes: &view.bytes[offset as usize..],
            stride,
            size,
        })
    }

    /// The numbers of a column with those of its sparse part put in.
    fn merge<'s>(
        &'s self,
        dense: &Column<'_>,
        sparse: &schema::Sparse,
        what: &'static str,
    ) -> Result<Data<'s>, MeshError> {
        let (count, components) = (dense.count, dense.components);
        let limit = self.limits.max_vertices.saturating_mul(4);
        let length = count.saturating_mul(components);
        if length > limit {
            return Err(MeshError::TooLarge {
                what: "numbers in a sparse accessor",
                found: length,
                limit,
            });
        }
        let kept = self.keep(8 * length, "bytes in sparse accessors")?;
        self.work.spend(length, 1, SPARSE)?;
        let mut numbers = vec![0.0; length];
        if !matches!(dense.data, Data::Zero) {
            for (block, slots) in numbers.chunks_mut(BLOCK * components).enumerate() {
                self.work.spend(slots.len(), 5, SPARSE)?;
                for (at, slot) in slots.iter_mut().enumerate() {
                    *slot = dense.number(block * BLOCK + at / components, at % components);
                }
            }
        }
        self.put_in(dense, sparse, &mut numbers, what)?;
        Ok(Data::Merged { numbers, _kept: kept })
    }

    /// Puts the sparse numbers in their places.
    fn put_in(
        &self,
        dense: &Column<'_>,
        sparse: &schema::Sparse,
        numbers: &mut [f64],
        what: &str,
    ) -> Result<(), MeshError> {
        let (count, components) = (dense.count, dense.components);
        let changed = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
        if changed > count {
            return Err(self.malformed(format!("{what}: {changed} sparse values for {count} elements")));
        }
        let Checked::Valid(index_type) = &sparse.indices.component_type else {
            return Err(self.malformed(format!("{what}: unknown type of sparse indices")));
        };
        let (index_type, width) = (index_type.0, dense.component.size());
        let (at, of) = (&sparse.indices, &sparse.values);
        let indices = self.elements(at.buffer_view, at.byte_offset, changed, index_type.size(), what)?;
        let values = self.elements(of.buffer_view, of.byte_offset, changed, components * width, what)?;
        for k in 0..changed {
            if k % BLOCK == 0 {
                self.work.spend(BLOCK.min(changed - k) * components, 8, SPARSE)?;
            }
            let at = decode(index_type, indices.get(k)) as usize;
            if at >= count {
                return Err(self.malformed(format!("{what}: sparse index {at} of {count} elements")));
            }
            let target = &mut numbers[at * components..(at + 1) * components];
            for (slot, b) in target.iter_mut().zip(values.get(k).chunks_exact(width)) {
                *slot = dense.value(decode(dense.component, b));
            }
        }
        Ok(())
    }
}

const SPARSE: &str = "steps of reading its sparse accessors";
