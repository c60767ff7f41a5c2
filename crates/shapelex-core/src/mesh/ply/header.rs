//! The header of a PLY file.

use super::super::scan::excerpt;
use super::super::{Format, MeshError};

/// Longest header read, in bytes.
const MAX_HEADER: usize = 1 << 20;

pub(super) fn malformed(detail: impl Into<String>) -> MeshError {
    MeshError::malformed(Format::Ply, detail)
}

/// How the numbers after the header are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"int64" => Self::I64,
            b"uint64" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    #[inline]
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// The type of a property.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Type {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A value each element of a kind has.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    pub name: Vec<u8>,
    pub value: Type,
}

impl Property {
    /// 0, 1 or 2 for a number `x`, `y` or `z`.
    pub fn axis(&self) -> Option<usize> {
        let axis = [b"x", b"y", b"z"].iter().position(|axis| self.name == *axis)?;
        matches!(self.value, Type::Scalar(_)).then_some(axis)
    }

    /// Whether it is a face's list of vertices.
    pub fn is_index_list(&self) -> bool {
        let named = |name: &[u8]| self.name.eq_ignore_ascii_case(name);
        matches!(self.value, Type::List { .. }) && (named(b"vertex_indices") || named(b"vertex_index"))
    }
}

/// A kind of element and how many of it there are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    pub name: Vec<u8>,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What the file holds, in its order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
}

/// Whether bytes begin with the line `ply`.
pub(in super::super) fn has_magic(bytes: &[u8]) -> bool {
    let Some(rest) = bytes.strip_prefix(b"ply") else {
        return false;
    };
    let blanks = rest.iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
    matches!(rest.get(blanks), Some(b'\n' | b'\r'))
}

impl Header {
    /// Parses a header and returns it with the bytes after it.
    ///
    /// Comments, blank lines and `obj_info` may be anywhere and in any encoding; names are what is left of their line.
    pub fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), MeshError> {
        if !has_magic(bytes) {
            return Err(malformed("it does not begin with a line `ply`"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut lines = Lines::new(bytes);
        lines.next();
        while let Some((number, line)) = lines.next() {
            let statement = line.trim_ascii();
            let (word, rest) = split_word(statement);
            let wrong = |reason: &str| {
                let text = excerpt(statement);
                malformed(format!("line {number}, `{text}`: {reason}"))
            };
            match word {
                b"end_header" if rest.is_empty() => {
                    let encoding = encoding.ok_or_else(|| malformed("its header has no line `format`"))?;
                    return Ok((Self { encoding, elements }, lines.rest));
                }
                b"end_header" => return Err(wrong("`end_header` is not alone on its line")),
                b"" | b"comment" | b"obj_info" => {}
                b"format" => {
                    let known = parse_encoding(rest);
                    encoding = Some(known.ok_or_else(|| wrong("not an encoding of PLY 1.0"))?);
                }
                b"element" => elements.push(parse_element(rest).ok_or_else(|| wrong("not a PLY statement"))?),
                b"property" => {
                    let property = parse_property(rest).ok_or_else(|| wrong("not a PLY statement"))?;
                    let element = elements.last_mut();
                    element
                        .ok_or_else(|| wrong("a property before the first element"))?
                        .properties
                        .push(property);
                }
                _ => return Err(wrong("not a PLY statement")),
            }
        }
        let detail = if bytes.len() > MAX_HEADER {
            "its first megabyte has no line `end_header`"
        } else {
            "its header has no line `end_header`"
        };
        Err(MeshError::truncated(Format::Ply, detail))
    }
}

fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(|&b| b <= b' ').unwrap_or(text.len());
    (&text[..end], text[end..].trim_ascii())
}

fn parse_encoding(text: &[u8]) -> Option<Encoding> {
    let (name, version) = split_word(text);
    if version != b"1.0" {
        return None;
    }
    match name {
        b"ascii" => Some(Encoding::Ascii),
        b"binary_little_endian" => Some(Encoding::LittleEndian),
        b"binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn parse_element(text: &[u8]) -> Option<Element> {
    let (name, count) = split_word(text);
    Some(Element {
        name: name.to_vec(),
        count: std::str::from_utf8(count).ok()?.parse().ok()?,
        properties: Vec::new(),
    })
}

fn parse_property(text: &[u8]) -> Option<Property> {
    let (first, rest) = split_word(text);
    let (value, name) = if first == b"list" {
        let (count, rest) = split_word(rest);
        let (item, name) = split_word(rest);
        let (count, item) = (Scalar::parse(count)?, Scalar::parse(item)?);
        (Type::List { count, item }, name)
    } else {
        (Type::Scalar(Scalar::parse(first)?), rest)
    };
    (!name.is_empty()).then(|| Property {
        name: name.to_vec(),
        value,
    })
}

/// The lines of a header, counted from 1.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
    /// Bytes that may still belong to the header.
    left: usize,
    /// Whether the first line ends in a carriage return alone. Then a line feed after another one is not part of the
    /// line end: it may be the first byte after the header.
    lone_returns: bool,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let end = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let lone_returns = end.is_some_and(|k| bytes[k] == b'\r' && bytes.get(k + 1) != Some(&b'\n'));
        Self {
            rest: bytes,
            number: 0,
            left: MAX_HEADER,
            lone_returns,
        }
    }

    fn next(&mut self) -> Option<(usize, &'a [u8])> {
        let within = &self.rest[..self.rest.len().min(self.left)];
        if within.is_empty() {
            return None;
        }
        let end = memchr::memchr2(b'\n', b'\r', within);
        // The last line of a file needs no end.
        let end = end.or((within.len() == self.rest.len()).then_some(within.len()))?;
        let line = &self.rest[..end];
        let after = match &self.rest[end..] {
            [b'\r', b'\n', ..] if !self.lone_returns => 2,
            [] => 0,
            _ => 1,
        };
        self.left -= (end + after).min(self.left);
        self.rest = &self.rest[end + after..];
        self.number += 1;
        Some((self.number, line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(header: &str) -> String {
        match Header::parse(header.as_bytes()) {
            Err(error) => error.to_string(),
            Ok((header, _)) => panic!("{header:?}"),
        }
    }

    #[test]
    fn a_header_is_read_with_every_freedom_it_has() {
        let text = "ply \ncomment end_header\n\n  obj_info x\nformat  ascii 1.0\nelement vertex 3\nproperty float my x #2\n\
                    comment\nproperty list uint8 int32 v\nelement vertex 4\nend_header \nrest";
        let expected = Header {
            encoding: Encoding::Ascii,
            elements: vec![
                Element {
                    name: b"vertex".to_vec(),
                    count: 3,
                    properties: vec![
                        Property {
                            name: b"my x #2".to_vec(),
                            value: Type::Scalar(Scalar::F32),
                        },
                        Property {
                            name: b"v".to_vec(),
                            value: Type::List {
                                count: Scalar::U8,
                                item: Scalar::I32,
                            },
                        },
                    ],
                },
                Element {
                    name: b"vertex".to_vec(),
                    count: 4,
                    properties: Vec::new(),
                },
            ],
        };
        for end in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', end);
            assert_eq!(
                Header::parse(text.as_bytes()),
                Ok((expected.clone(), b"rest".as_slice())),
                "{end:?}"
            );
        }
        // A first byte of 10 after a header of carriage returns belongs to the numbers.
        let (_, rest) = Header::parse(b"ply\rformat ascii 1.0\rend_header\r\nx").expect("a header");
        assert_eq!(rest, b"\nx");
    }

    #[test]
    fn a_slip_is_named_by_its_line() {
        let head = "ply\nformat ascii 1.0\nelement vertex 3\n";
        for (line, reason) in [
            ("property", "not a PLY statement"),
            ("property float", "not a PLY statement"),
            ("property float99 x", "not a PLY statement"),
            ("property list uchar vertex_index", "not a PLY statement"),
            ("element face", "not a PLY statement"),
            ("element face -1", "not a PLY statement"),
            ("elephant", "not a PLY statement"),
            ("format ascii 2.0", "not an encoding of PLY 1.0"),
            ("end_header now", "not alone"),
        ] {
            let text = error(&format!("{head}{line}\nend_header\n"));
            assert!(
                text.contains(&format!("line 4, `{line}`")) && text.contains(reason),
                "{text}"
            );
            assert!(!text.contains('\n'));
        }
        assert!(error("ply\nend_header\n").contains("no line `format`"));
        assert!(error("ply\nformat ascii 1.0\nproperty int x\n").contains("before the first element"));
        assert!(error("plyformat ascii 1.0\n").contains("a line `ply`"));
        assert!(error(head).contains("no line `end_header`"));
        let long = format!("ply\n{}", "comment x\n".repeat(MAX_HEADER / 10 + 1));
        assert!(error(&long).contains("first megabyte"));
    }
}
