//! The numbers after the header of a PLY file.
//!
//! In binary files they follow each other. In ascii files an element is a line, and writers deviate from that in three
//! ways, told apart by the number of lines that are not blank:
//!
//! - As many as there are elements: what a line has beyond the element's numbers is passed over; fewer are an error.
//! - More: an element may continue on the next line; what is left on its last line is passed over.
//! - Fewer: lines mean nothing, numbers follow each other.

use super::super::precision::Decimal;
use super::super::scan::Scanner;
use super::super::{Format, MeshError};
use super::header::{Element, Encoding, Header, Scalar, Type, malformed};
use crate::cancel::Cancel;

/// Items of a list between two looks at the stop flag.
const STRIDE: usize = 4096;

/// What a line is in an ascii file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lines {
    Elements,
    Broken,
    Blank,
}

/// The bytes after the header, read number by number.
pub(super) enum Payload<'a> {
    Ascii(Rows<'a>),
    Little(&'a [u8]),
    Big(&'a [u8]),
}

/// The rows of an ascii file.
pub(super) struct Rows<'a> {
    scan: Scanner<'a>,
    lines: Lines,
    /// Lines that are not blank, at most one more than there are elements.
    found: usize,
    elements: usize,
}

fn truncated(detail: impl Into<String>) -> MeshError {
    MeshError::truncated(Format::Ply, detail)
}

impl<'a> Payload<'a> {
    /// The payload of a file.
    pub fn new(header: &Header, bytes: &'a [u8], cancel: &'a Cancel) -> Self {
        match header.encoding {
            Encoding::LittleEndian => Self::Little(bytes),
            Encoding::BigEndian => Self::Big(bytes),
            Encoding::Ascii => {
                let scan = Scanner::new(bytes).stopped_by(cancel);
                let counts = header.elements.iter().filter(|e| !e.properties.is_empty());
                let elements = counts.fold(0usize, |sum, e| sum.saturating_add(e.count));
                let found = scan.content_lines(elements.saturating_add(1));
                let lines = match found.cmp(&elements) {
                    std::cmp::Ordering::Less => Lines::Blank,
                    std::cmp::Ordering::Equal => Lines::Elements,
                    std::cmp::Ordering::Greater => Lines::Broken,
                };
                Self::Ascii(Rows {
                    scan,
                    lines,
                    found,
                    elements,
                })
            }
        }
    }

    /// What an error of the numbers means, given the number of lines.
    pub fn explain(&self, error: MeshError) -> MeshError {
        match self {
            Self::Ascii(rows) => error.unless_cut_short(Format::Ply, rows.found, rows.elements),
            Self::Little(_) | Self::Big(_) => error,
        }
    }

    fn remaining(&self) -> usize {
        match self {
            Self::Ascii(rows) => rows.scan.remaining(),
            Self::Little(rest) | Self::Big(rest) => rest.len(),
        }
    }

    /// The fewest bytes a scalar takes: a digit and a blank in ascii.
    fn least(&self, scalar: Scalar) -> usize {
        match self {
            Self::Ascii(_) => 2,
            Self::Little(_) | Self::Big(_) => scalar.size(),
        }
    }

    /// Refuses an element whose count promises more than the remaining bytes could hold.
    pub fn check(&self, element: &Element) -> Result<(), MeshError> {
        let least = |value: &Type| match value {
            Type::Scalar(scalar) | Type::List { count: scalar, .. } => self.least(*scalar),
        };
        let row: usize = element.properties.iter().map(|p| least(&p.value)).sum();
        // The last number of an ascii file needs no blank after it.
        if element.count.saturating_mul(row) > self.remaining() + 1 {
            return Err(truncated(format!(
                "its header promises {} of `{}`, but only {} bytes follow",
                element.count,
                String::from_utf8_lossy(&element.name),
                self.remaining()
            )));
        }
        Ok(())
    }

    /// Goes to the start of an element.
    #[inline]
    pub fn begin(&mut self, element: &Element, k: usize) -> Result<(), MeshError> {
        let Self::Ascii(rows) = self else { return Ok(()) };
        if !rows.scan.next_content() {
            let name = String::from_utf8_lossy(&element.name);
            return Err(truncated(format!(
                "it ends before {name} {k} of {}",
                element.count
            )));
        }
        Ok(())
    }

    /// Goes past an element's last number.
    #[inline]
    pub fn end(&mut self) {
        if let Self::Ascii(rows) = self
            && rows.lines != Lines::Blank
        {
            rows.scan.next_line();
        }
    }

    /// Reads a number.
    #[inline]
    pub fn scalar(&mut self, scalar: Scalar) -> Result<Decimal, MeshError> {
        match self {
            Self::Little(rest) => take(rest, scalar, |_| ()),
            Self::Big(rest) => take(rest, scalar, |b| b.reverse()),
            Self::Ascii(rows) => rows.next(Scanner::decimal),
        }
    }

    /// Reads a number that is most likely an integer.
    #[inline]
    pub fn index(&mut self, scalar: Scalar) -> Result<f64, MeshError> {
        let Self::Ascii(rows) = self else {
            return self.scalar(scalar).map(|x| x.value);
        };
        rows.next(|scan| {
            let whole = scan.whole_integer().map(|k| k as f64);
            whole.or_else(|| scan.number())
        })
    }

    /// Reads the length of a list whose items are of type `item`.
    #[inline]
    pub fn length(&mut self, count: Scalar, item: Scalar) -> Result<usize, MeshError> {
        let length = self.index(count)?;
        if !(length >= 0.0 && length.fract() == 0.0) {
            return Err(malformed(format!("a list has the length {length}")));
        }
        let length = length as usize;
        if length.saturating_mul(self.least(item)) > self.remaining() + 1 {
            return Err(truncated(format!(
                "a list promises {length} items, more than follow"
            )));
        }
        Ok(length)
    }

    /// Steps over a property.
    #[inline]
    pub fn skip(&mut self, value: Type) -> Result<(), MeshError> {
        match value {
            Type::Scalar(scalar) => self.scalar(scalar).map(drop),
            Type::List { count, item } => {
                let length = self.length(count, item)?;
                if let Self::Little(rest) | Self::Big(rest) = self {
                    let bytes = length.saturating_mul(item.size());
                    *rest = rest
                        .get(bytes..)
                        .ok_or_else(|| truncated("it ends within a list"))?;
                    return Ok(());
                }
                for k in 0..length {
                    if let Self::Ascii(rows) = self
                        && k.is_multiple_of(STRIDE)
                    {
                        rows.scan.look_at_cancel();
                    }
                    self.scalar(item)?;
                }
                Ok(())
            }
        }
    }
}

impl<'a> Rows<'a> {
    #[inline]
    fn next<T>(&mut self, read: impl FnOnce(&mut Scanner<'a>) -> Option<T>) -> Result<T, MeshError> {
        let ended = match self.lines {
            Lines::Elements => self.scan.line_done(),
            Lines::Broken | Lines::Blank => !self.scan.skip_whitespace(),
        };
        if ended {
            return Err(self.too_short());
        }
        read(&mut self.scan).ok_or_else(|| {
            let (line, text) = (self.scan.line_number(), self.scan.excerpt());
            malformed(format!(
                "line {line} after the header, `{text}`: expected a number"
            ))
        })
    }

    #[cold]
    fn too_short(&self) -> MeshError {
        if self.scan.at_end() {
            return truncated("it ends within an element");
        }
        malformed(format!(
            "line {} after the header has fewer numbers than its element",
            self.scan.line_number()
        ))
    }
}

#[inline]
fn take(rest: &mut &[u8], scalar: Scalar, turn: impl Fn(&mut [u8])) -> Result<Decimal, MeshError> {
    let Some((head, tail)) = rest.split_at_checked(scalar.size()) else {
        return Err(truncated("it ends within an element"));
    };
    *rest = tail;
    let mut b = [0u8; 8];
    b[..head.len()].copy_from_slice(head);
    turn(&mut b[..head.len()]);
    Ok(Decimal::exact(match scalar {
        Scalar::I8 => f64::from(b[0] as i8),
        Scalar::U8 => f64::from(b[0]),
        Scalar::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        Scalar::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        Scalar::I32 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::I64 => i64::from_le_bytes(b) as f64,
        Scalar::U64 => u64::from_le_bytes(b) as f64,
        Scalar::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::F64 => f64::from_le_bytes(b),
    }))
}
