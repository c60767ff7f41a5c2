//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: a buffer view as a stream of meshoptimizer's codecs.
//!
//! The codecs are C++ that is safe for any stream as long as the sizes it is called with are right; [`Layout`] has
//! checked them.

use super::schema::Meshopt;

/// Largest distance of two vertices, in bytes.
const MAX_STRIDE: usize = 256;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    /// Vertices.
    Attributes,
    /// Triangles.
    Triangles,
    /// Indices of any kind.
    Indices,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Filter {
    None,
    /// Unit vectors by two components.
    Octahedral,
    /// Unit quaternions by three components.
    Quaternion,
    /// Floats as a mantissa of 24 bits and an exponent of 8.
    Exponential,
    /// Colours as luma and chroma.
    Colour,
}

/// What a stream holds: sizes that fit each other and the codec.
pub(super) struct Layout {
    mode: Mode,
    filter: Filter,
    count: usize,
    stride: usize,
}

impl Layout {
    /// Checks what a view declares; the error says what is wrong.
    pub fn parse(declared: &Meshopt<'_>) -> Result<Self, String> {
        let mode = match &*declared.mode {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            "INDICES" => Mode::Indices,
            other => return Err(format!("meshopt compression of unknown mode `{other}`")),
        };
        let filter = match declared.filter.as_deref().unwrap_or("NONE") {
            "NONE" => Filter::None,
            "OCTAHEDRAL" => Filter::Octahedral,
            "QUATERNION" => Filter::Quaternion,
            "EXPONENTIAL" => Filter::Exponential,
            "COLOR" => Filter::Colour,
            other => return Err(format!("meshopt compression with unknown filter `{other}`")),
        };
        let (count, stride) = (declared.count.0, declared.byte_stride.0);
        let bytes = count.checked_mul(stride).and_then(|b| usize::try_from(b).ok());
        let (Some(_), Ok(count), Ok(stride)) = (bytes, usize::try_from(count), usize::try_from(stride))
        else {
            return Err(format!(
                "meshopt compression of {count} elements of {stride} bytes"
            ));
        };
        let stride_fits = match (mode, filter) {
            (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
            (Mode::Triangles | Mode::Indices, _) => false,
            (Mode::Attributes, Filter::None | Filter::Exponential) => {
                stride > 0 && stride <= MAX_STRIDE && stride.is_multiple_of(4)
            }
            (Mode::Attributes, Filter::Octahedral | Filter::Colour) => stride == 4 || stride == 8,
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
        };
        if !stride_fits || (mode == Mode::Triangles && !count.is_multiple_of(3)) {
            return Err(format!(
                "meshopt compression of {count} elements of {stride} bytes does not fit its mode and filter"
            ));
        }
        Ok(Self {
            mode,
            filter,
            count,
            stride,
        })
    }

    /// Bytes of the decompressed view.
    pub fn bytes(&self) -> usize {
        self.count * self.stride
    }

    /// Decompresses a stream.
    pub fn decode(&self, stream: &[u8]) -> Result<Vec<u8>, String> {
        let decoded = match (self.mode, self.stride) {
            (Mode::Attributes, _) => return self.vertices(stream),
            (Mode::Triangles, 2) => meshopt::decode_index_buffer(stream, self.count).map(|i| shorts(&i)),
            (Mode::Triangles, _) => meshopt::decode_index_buffer(stream, self.count).map(|i| words(&i)),
            (Mode::Indices, 2) => meshopt::decode_index_sequence(stream, self.count).map(|i| shorts(&i)),
            (Mode::Indices, _) => meshopt::decode_index_sequence(stream, self.count).map(|i| words(&i)),
        };
        decoded.map_err(broken)
    }

    fn vertices(&self, stream: &[u8]) -> Result<Vec<u8>, String> {
        match self.filter {
            Filter::None => self.plain(stream),
            Filter::Exponential => {
                let mut data: Vec<[u32; 1]> = self
                    .plain(stream)?
                    .as_chunks::<4>()
                    .0
                    .iter()
                    .map(|b| [u32::from_le_bytes(*b)])
                    .collect();
                meshopt::decode_filter_exp(&mut data);
                Ok(words(data.as_flattened()))
            }
            Filter::Quaternion => {
                let mut data: Vec<[i16; 4]> = decode(stream, self.count)?;
                meshopt::decode_filter_quat(&mut data);
                Ok(data.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
            }
            Filter::Octahedral if self.stride == 8 => {
                let mut data: Vec<[i16; 4]> = decode(stream, self.count)?;
                meshopt::decode_filter_oct(&mut data);
                Ok(data.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
            }
            Filter::Octahedral => {
                let mut data: Vec<[i8; 4]> = decode(stream, self.count)?;
                meshopt::decode_filter_oct(&mut data);
                Ok(data.iter().flatten().map(|x| *x as u8).collect())
            }
            Filter::Colour if self.stride == 8 => {
                let mut data: Vec<[u16; 4]> = decode(stream, self.count)?;
                meshopt::decode_filter_color(&mut data);
                Ok(data.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
            }
            Filter::Colour => {
                let mut data: Vec<[u8; 4]> = decode(stream, self.count)?;
                meshopt::decode_filter_color(&mut data);
                Ok(data.into_flattened())
            }
        }
    }

    fn plain(&self, stream: &[u8]) -> Result<Vec<u8>, String> {
        // The crate takes the stride from a type; there is one for each multiple of 4.
        macro_rules! by_stride {
            ($($words:literal)*) => {
                match self.stride / 4 {
                    $($words => {
                        let elements = decode::<Element<$words>>(stream, self.count)?;
                        let mut bytes = Vec::with_capacity(self.bytes());
                        elements.iter().for_each(|e| bytes.extend_from_slice(e.0.as_flattened()));
                        Ok(bytes)
                    })*
                    _ => Err(format!("meshopt compression of elements of {} bytes", self.stride)),
                }
            };
        }
        by_stride!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
            33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
    }
}

/// An element of `4·WORDS` bytes.
#[derive(Clone)]
struct Element<const WORDS: usize>([[u8; 4]; WORDS]);

impl<const WORDS: usize> Default for Element<WORDS> {
    fn default() -> Self {
        Self([[0; 4]; WORDS])
    }
}

fn decode<T: Clone + Default>(stream: &[u8], count: usize) -> Result<Vec<T>, String> {
    meshopt::decode_vertex_buffer(stream, count).map_err(broken)
}

fn broken(error: meshopt::Error) -> String {
    format!("meshopt compression: the stream is broken ({error})")
}

fn shorts(indices: &[u16]) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes()).collect()
}

fn words(indices: &[u32]) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes()).collect()
}
