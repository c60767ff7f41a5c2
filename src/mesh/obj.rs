//! Wavefront OBJ.
//!
//! Shape is all that is kept: `v` and `f` statements of all groups and objects together, in the file's order. Texture
//! coordinates, normals, materials, lines, points and names are passed over, so a missing or unreadable one cannot
//! hurt, and a material file is never opened.
//!
//! A pass over the bytes reads what nearly every file consists of, an order of magnitude faster than tobj and without
//! reordering vertices. A statement it cannot read sends the whole file to tobj, which has the last word.

use super::scan::Scanner;
use super::{Format, Limits, MeshError, ReadContext, TriangleSoup};
use std::borrow::Cow;

/// Reads an OBJ file. Vertices keep the file's order, used or not; a fourth number on a `v` line is a weight that
/// divides the others, and more are colours.
///
/// Errors: [`MeshError::IndexOutOfRange`] gives the index as the file has it, from 1 or negative, and the `f`
/// statement counted from 1. [`MeshError::Malformed`] names the line.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let limits = &context.limits;
    let text = join_continued_lines(bytes);
    let soup = match parse(&text, limits)? {
        Parsed::Soup(soup) => soup,
        Parsed::Unusual { line, excerpt } => {
            check_counts(&text, limits)?;
            parse_with_tobj(&text).map_err(|error| {
                MeshError::malformed(Format::Obj, format!("line {line}, `{excerpt}`: {error}"))
            })?
        }
    };
    if soup.vertices.is_empty() && soup.faces.is_empty() {
        return Err(MeshError::malformed(Format::Obj, "it has no `v` statement"));
    }
    soup.checked(Format::Obj, limits)
}

/// A backslash before a line end continues the statement on the next line: both become blanks.
fn join_continued_lines(bytes: &[u8]) -> Cow<'_, [u8]> {
    let continued = |w: &[u8]| w[0] == b'\\' && (w[1] == b'\n' || w[1] == b'\r');
    if !bytes.contains(&b'\\') || !bytes.windows(2).any(continued) {
        return Cow::Borrowed(bytes);
    }
    let mut joined = bytes.to_vec();
    for k in 0..joined.len() - 1 {
        if continued(&joined[k..k + 2]) {
            let crlf = joined[k + 1] == b'\r' && joined.get(k + 2) == Some(&b'\n');
            let end = k + if crlf { 3 } else { 2 };
            joined[k..end].fill(b' ');
        }
    }
    Cow::Owned(joined)
}

/// What the fast pass made of a text.
enum Parsed {
    /// The soup, with indices checked.
    Soup(TriangleSoup),
    /// A `v` or `f` statement it does not read.
    Unusual { line: usize, excerpt: String },
}

fn parse(text: &[u8], limits: &Limits) -> Result<Parsed, MeshError> {
    let mut soup = TriangleSoup::default();
    let mut polygon = Vec::new();
    let mut statement = 0usize;
    // Faces may name vertices of later lines. The largest index so used, with its statement, is checked at the end.
    let mut furthest = (0i64, 0usize);
    let mut scan = Scanner::new(text);
    while scan.next_content() {
        let start = scan.clone();
        let ok = match scan.rest() {
            [b'v', b' ' | b'\t', ..] => {
                scan.word();
                let vertex = vertex(&mut scan);
                if let Some(vertex) = vertex {
                    soup.vertices.push(vertex);
                    limits.check_vertices(soup.vertices.len())?;
                }
                vertex.is_some()
            }
            [b'f', b' ' | b'\t', ..] => {
                scan.word();
                statement += 1;
                polygon.clear();
                let known = soup.vertices.len() as i64;
                let out_of_range = |index| MeshError::IndexOutOfRange {
                    face: statement,
                    index,
                    vertices: soup.vertices.len(),
                };
                let mut ok = true;
                while ok && !scan.line_done() {
                    let Some((index, clean)) = corner(&mut scan) else {
                        ok = false;
                        break;
                    };
                    ok = clean;
                    let absolute = if index < 0 { known + index } else { index - 1 };
                    if index == 0 || absolute < 0 || absolute > i64::from(u32::MAX) {
                        return Err(out_of_range(index));
                    }
                    if index > known && index > furthest.0 {
                        furthest = (index, statement);
                    }
                    polygon.push(absolute as u32);
                }
                soup.push_polygon(&polygon, limits)?;
                ok
            }
            _ => true,
        };
        if !ok {
            return Ok(Parsed::Unusual {
                line: start.line_number(),
                excerpt: start.excerpt(),
            });
        }
        scan.next_line();
    }
    if furthest.0 > soup.vertices.len() as i64 {
        return Err(MeshError::IndexOutOfRange {
            face: furthest.1,
            index: furthest.0,
            vertices: soup.vertices.len(),
        });
    }
    Ok(Parsed::Soup(soup))
}

/// The numbers after `v`: three coordinates, or four with a weight, or coordinates and colours.
fn vertex(scan: &mut Scanner<'_>) -> Option<[f64; 3]> {
    let point = [scan.number()?, scan.number()?, scan.number()?];
    if scan.line_done() {
        return Some(point);
    }
    let weight = scan.number();
    if !scan.line_done() {
        return Some(point);
    }
    match weight {
        Some(w) if w != 0.0 => Some(point.map(|x| x / w)),
        _ => None,
    }
}

/// One corner of a face: its vertex index, with whatever follows a slash passed over, and whether the word held
/// nothing else.
fn corner(scan: &mut Scanner<'_>) -> Option<(i64, bool)> {
    let index = scan.integer()?;
    let rest = scan.word_rest();
    Some((index, rest.is_empty() || rest[0] == b'/'))
}

/// Counts what tobj would allocate for, against the limits.
fn check_counts(text: &[u8], limits: &Limits) -> Result<(), MeshError> {
    let (mut vertices, mut faces) = (0, 0);
    let mut scan = Scanner::new(text);
    while scan.next_content() {
        match scan.word() {
            b"v" => vertices += 1,
            b"f" => {
                let mut corners = 0usize;
                while !scan.line_done() {
                    scan.word();
                    corners += 1;
                }
                faces += corners.saturating_sub(2);
            }
            _ => {}
        }
        scan.next_line();
    }
    limits.check_vertices(vertices)?;
    limits.check_faces(faces)
}

/// The statements tobj gets: those a face depends on. Not `l`, which it turns into polygons, nor names, which may not
/// be UTF-8.
const PASSED_TO_TOBJ: [&[u8]; 4] = [b"v", b"vn", b"vt", b"f"];

/// Reads with tobj. It orders vertices by first use and drops those no face uses.
fn parse_with_tobj(text: &[u8]) -> Result<TriangleSoup, tobj::LoadError> {
    let mut kept = Vec::with_capacity(text.len());
    let mut scan = Scanner::new(text);
    while scan.next_content() {
        let line = scan.rest();
        if PASSED_TO_TOBJ.contains(&scan.word()) {
            scan.next_line();
            kept.extend(line[..line.len() - scan.remaining()].iter().map(|&b| b.min(b'~')));
        } else {
            scan.next_line();
        }
    }
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let (models, _) = tobj::load_obj_buf(&mut kept.as_slice(), &options, |_| {
        Err(tobj::LoadError::OpenFileFailed)
    })?;
    let mut soup = TriangleSoup::default();
    for model in models {
        let base = soup.vertices.len() as u32;
        let positions = model.mesh.positions.chunks_exact(3);
        soup.vertices.extend(positions.map(|p| [p[0], p[1], p[2]]));
        let corners = model.mesh.indices.chunks_exact(3);
        soup.faces
            .extend(corners.map(|f| [base + f[0], base + f[1], base + f[2]]));
    }
    Ok(soup)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::path::Path;

    fn corners(soup: &TriangleSoup) -> Vec<[[f64; 3]; 3]> {
        soup.faces
            .iter()
            .map(|f| f.map(|k| soup.vertices[k as usize]))
            .collect()
    }

    fn fast(text: &[u8]) -> Option<TriangleSoup> {
        match parse(text, &Limits::default()).expect("a valid file") {
            Parsed::Soup(soup) => Some(soup),
            Parsed::Unusual { .. } => None,
        }
    }

    /// A face of corners with an index form each, resolved against `v`, `t`, `n` statements so far.
    #[derive(Clone, Debug)]
    enum Statement {
        Vertex([f64; 3], Option<f64>, bool),
        Texture,
        Normal,
        Face(Vec<(u16, bool, u8)>),
        Noise(&'static str),
    }

    fn statement() -> impl Strategy<Value = Statement> {
        let number = prop_oneof![-1e3..1e3f64, -1e-9..1e-9f64, any::<f32>().prop_map(f64::from)]
            .prop_filter("finite", |x| x.is_finite());
        let weight = prop::option::weighted(0.2, 0.5..2.0f64);
        prop_oneof![
            6 => ([number.clone(), number.clone(), number], weight, any::<bool>())
                .prop_map(|(p, w, e)| Statement::Vertex(p, w, e)),
            1 => Just(Statement::Texture),
            1 => Just(Statement::Normal),
            4 => prop::collection::vec((any::<u16>(), any::<bool>(), 0..4u8), 3..7).prop_map(Statement::Face),
            2 => prop::sample::select(vec![
                "g left paw", "o cat", "s off", "usemtl fur", "mtllib a.mtl", "", "# v 1 2 3", "  ", "s 1",
            ]).prop_map(Statement::Noise),
        ]
    }

    fn write(statements: &[Statement]) -> String {
        let (mut v, mut t, mut n) = (0usize, 0usize, 0usize);
        let mut text = String::new();
        for s in statements {
            match s {
                Statement::Vertex(p, w, exponent) => {
                    v += 1;
                    text += &match exponent {
                        true => format!("v {:e} {:e} {:e}", p[0], p[1], p[2]),
                        false => format!("v  {} {}\t{}", p[0], p[1], p[2]),
                    };
                    text += &w.map(|w| format!(" {w}")).unwrap_or_default();
                }
                Statement::Texture => {
                    t += 1;
                    text += "vt 0.5 0.5";
                }
                Statement::Normal => {
                    n += 1;
                    text += "vn 0 0 1";
                }
                Statement::Face(corners) if v > 0 => {
                    text += "f";
                    for &(k, negative, form) in corners {
                        let k = k as usize % v;
                        let index = if negative {
                            k as i64 - v as i64
                        } else {
                            k as i64 + 1
                        };
                        text += &match form {
                            1 if t > 0 => format!(" {index}/{t}"),
                            2 if n > 0 => format!(" {index}//{n}"),
                            3 if t > 0 && n > 0 => format!(" {index}/-1/-1"),
                            _ => format!(" {index}"),
                        };
                    }
                }
                Statement::Face(_) => {}
                Statement::Noise(line) => text += line,
            }
            text += "\n";
        }
        text
    }

    proptest! {
        #[test]
        fn the_fast_pass_agrees_with_tobj(statements in prop::collection::vec(statement(), 1..60)) {
            let text = write(&statements);
            let ours = fast(text.as_bytes()).expect("usual statements");
            let theirs = parse_with_tobj(text.as_bytes()).expect("usual statements");
            prop_assert_eq!(corners(&ours), corners(&theirs), "{}", text);
            let crlf = text.replace('\n', "\r\n");
            prop_assert_eq!(&ours, &fast(crlf.as_bytes()).expect("usual statements"));
        }
    }

    #[test]
    fn the_fast_pass_agrees_with_tobj_on_real_files() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/sumner");
        if !root.is_dir() {
            eprintln!("skipped: the_fast_pass_agrees_with_tobj_on_real_files: no ../shared/data");
            return;
        }
        let mut files = 0;
        for class in ["cat", "lion"] {
            for entry in std::fs::read_dir(root.join(class)).expect("a class directory") {
                let bytes = std::fs::read(entry.expect("an entry").path()).expect("a file");
                let ours = fast(&bytes).expect("usual statements");
                let theirs = parse_with_tobj(&bytes).expect("a valid file");
                assert!(ours.faces.len() > 9000);
                assert_eq!(corners(&ours), corners(&theirs));
                files += 1;
            }
        }
        assert_eq!(files, 20);
    }

    #[test]
    fn an_unusual_statement_goes_to_tobj_and_is_named_by_its_line() {
        let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 three\n";
        let error = read(text, &ReadContext::new(Limits::default())).expect_err("not a face");
        assert!(error.to_string().contains("line 5, `f 1 2 three`"), "{error}");
        // A line break tobj takes for a blank and we do not.
        let text = "v 0 0 0\nv 1\u{85}0 0\nv 0 1 0\nf 1 2 3\n";
        assert!(matches!(
            parse(text.as_bytes(), &Limits::default()),
            Ok(Parsed::Unusual { line: 2, .. })
        ));
    }
}
