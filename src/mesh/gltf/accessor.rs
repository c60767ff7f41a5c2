//! Numbers out of buffers: accessors, dense and sparse, of every component type.

use super::document::Document;
use crate::mesh::MeshError;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, buffer};

fn bytes_of(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

fn decode(component: ComponentType, b: &[u8]) -> f64 {
    match component {
        ComponentType::I8 => f64::from(b[0] as i8),
        ComponentType::U8 => f64::from(b[0]),
        ComponentType::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        ComponentType::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        ComponentType::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ComponentType::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
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

/// Elements of `size` bytes, `stride` apart, in a slice that holds `count` of them.
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

impl Document<'_> {
    /// `count` elements of `size` bytes from `offset` bytes into a view, after checking that they are inside.
    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        size: usize,
        what: &str,
    ) -> Result<Elements<'_>, MeshError> {
        let view = self.get(&self.root.buffer_views, view.value(), "buffer view")?;
        let buffer = self.buffer(view.buffer.value())?;
        let start = view.byte_offset.map_or(0, |o| o.0);
        let end = start.checked_add(view.byte_length.0);
        let bytes = end
            .filter(|&end| end <= buffer.len() as u64)
            .and_then(|end| buffer.get(start as usize..end as usize))
            .ok_or_else(|| {
                self.truncated(format!(
                    "{what}: its buffer view needs {} bytes from byte {start} of a buffer of {}",
                    view.byte_length.0,
                    buffer.len()
                ))
            })?;
        let stride = view.byte_stride.map_or(size, |s| s.0);
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
        if needed > bytes.len() as u64 {
            return Err(self.truncated(format!(
                "{what}: {count} elements need {needed} bytes of a buffer view of {}",
                bytes.len()
            )));
        }
        Ok(Elements {
            bytes: &bytes[offset as usize..],
            stride,
            size,
        })
    }

    /// How many elements an accessor has, by its own word.
    pub fn count(&self, index: Index<Accessor>) -> Result<usize, MeshError> {
        let accessor = self.get(&self.root.accessors, index.value(), "accessor")?;
        usize::try_from(accessor.count.0)
            .map_err(|_| self.malformed("an accessor's count is beyond all memory"))
    }

    /// Reads an accessor as a flat list of numbers, `components` of them per element, each through `convert`.
    ///
    /// `expected` is the element type it must have and `limit` the most elements it may; `what` names it in messages
    /// and in [`MeshError::TooLarge`].
    pub fn numbers<T: Clone>(
        &self,
        index: Index<Accessor>,
        expected: Type,
        limit: usize,
        what: &'static str,
        convert: impl Fn(f64) -> T,
    ) -> Result<Vec<T>, MeshError> {
        let accessor = self.get(&self.root.accessors, index.value(), "accessor")?;
        let (Checked::Valid(component), Checked::Valid(found)) = (&accessor.component_type, &accessor.type_)
        else {
            return Err(self.malformed(format!("{what}: unknown component or element type")));
        };
        let component = component.0;
        if *found != expected {
            return Err(self.malformed(format!(
                "{what}: elements of type {found:?}, expected {expected:?}"
            )));
        }
        let count = self.count(index)?;
        if count > limit {
            return Err(MeshError::TooLarge {
                what,
                found: count,
                limit,
            });
        }
        let components = expected.multiplicity();
        let width = bytes_of(component);
        let size = components * width;
        self.spend(count.saturating_mul(components))?;
        let value = |b: &[u8]| {
            let c = decode(component, b);
            convert(if accessor.normalized {
                (c / scale(component)).max(-1.0)
            } else {
                c
            })
        };
        let mut numbers = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |o| o.0);
                let elements = self.elements(view, offset, count, size, what)?;
                let mut numbers = Vec::with_capacity(count * components);
                for k in 0..count {
                    numbers.extend(elements.get(k).chunks_exact(width).map(value));
                }
                numbers
            }
            None if accessor.sparse.is_none() && self.compressed() => {
                return Err(MeshError::Unsupported {
                    format: self.format,
                    feature: "KHR_draco_mesh_compression".into(),
                });
            }
            None => vec![convert(0.0); count * components],
        };
        if let Some(sparse) = &accessor.sparse {
            let changed = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
            if changed > count {
                return Err(self.malformed(format!("{what}: {changed} sparse values for {count} elements")));
            }
            let Checked::Valid(index_type) = &sparse.indices.component_type else {
                return Err(self.malformed(format!("{what}: unknown type of sparse indices")));
            };
            let indices = self.elements(
                sparse.indices.buffer_view,
                sparse.indices.byte_offset.0,
                changed,
                bytes_of(index_type.0),
                what,
            )?;
            let values = self.elements(
                sparse.values.buffer_view,
                sparse.values.byte_offset.0,
                changed,
                size,
                what,
            )?;
            for k in 0..changed {
                let at = decode(index_type.0, indices.get(k)) as usize;
                if at >= count {
                    return Err(self.malformed(format!("{what}: sparse index {at} of {count} elements")));
                }
                let target = &mut numbers[at * components..(at + 1) * components];
                for (slot, b) in target.iter_mut().zip(values.get(k).chunks_exact(width)) {
                    *slot = value(b);
                }
            }
        }
        Ok(numbers)
    }

    /// Reads an accessor of points.
    pub fn points(&self, index: Index<Accessor>, what: &'static str) -> Result<Vec<[f64; 3]>, MeshError> {
        let flat = self.numbers(index, Type::Vec3, self.limits.max_vertices, what, |x| x)?;
        Ok(flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    }

    fn compressed(&self) -> bool {
        let used = &self.root.extensions_used;
        used.iter().any(|e| e == "KHR_draco_mesh_compression")
    }
}
