//! Files of the kinds that public bug reports describe (`tests/data/mesh/cases`), and their siblings.

use crate::encode::{fixture, read, read_as};
use shapelex_core::mesh::{Format, MeshError, TriangleSoup};

/// The area of an octahedron with its corners on the axes at a distance of 1.
const OCTAHEDRON: f64 = 6.928_203_230_275_509;

const VERTICES: [&str; 6] = ["1 0 0", "-1 0 0", "0 1 0", "0 -1 0", "0 0 1", "0 0 -1"];
const FACES: [[usize; 3]; 8] = [
    [0, 2, 4],
    [2, 1, 4],
    [1, 3, 4],
    [3, 0, 4],
    [2, 0, 5],
    [1, 2, 5],
    [3, 1, 5],
    [0, 3, 5],
];

fn area(soup: &TriangleSoup) -> f64 {
    let doubled = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|k| soup.vertices[k as usize]);
        let (u, v): ([f64; 3], [f64; 3]) = (
            std::array::from_fn(|k| b[k] - a[k]),
            std::array::from_fn(|k| c[k] - a[k]),
        );
        let n = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        n.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    soup.faces.iter().map(doubled).sum::<f64>() / 2.0
}

#[track_caller]
fn assert_reads(bytes: &[u8], what: &str, vertices: usize, faces: usize, expected: f64) {
    let soup = match read(bytes) {
        Ok((_, soup)) => soup,
        Err(error) => panic!("{what}: {error}"),
    };
    assert_eq!(
        (soup.vertices.len(), soup.faces.len()),
        (vertices, faces),
        "{what}"
    );
    assert!(
        (area(&soup) - expected).abs() < 1e-6 * expected,
        "{what}: {}",
        area(&soup)
    );
}

#[track_caller]
fn assert_octahedron(text: &str) {
    let what = text.chars().take(300).collect::<String>();
    assert_reads(text.as_bytes(), &what, 6, 8, OCTAHEDRON);
}

#[track_caller]
fn assert_refused(bytes: &[u8], format: Format, words: &[&str]) {
    let error = match read_as(bytes, Some(format)) {
        Err(error) => error.to_string(),
        Ok((_, soup)) => panic!("read: {} faces", soup.faces.len()),
    };
    for word in words {
        assert!(error.contains(word), "{error:?} does not say {word:?}");
    }
    assert!(!error.contains('\n'), "{error:?}");
}

#[test]
fn handed_files_read_right() {
    for (name, vertices, faces, expected) in [
        ("obj/concave_L.obj", 12, 20, 22.0),
        ("obj/concave_quad.obj", 4, 2, 1.5),
        ("obj/backslash_eof.obj", 6, 8, OCTAHEDRON),
        ("obj/comment_glued_to_face.obj", 6, 8, OCTAHEDRON),
        ("obj/nan_unreferenced.obj", 7, 8, OCTAHEDRON),
        ("off/counts_three_lines.off", 6, 8, OCTAHEDRON),
        ("off/ncoff.off", 6, 8, OCTAHEDRON),
        ("ply/dup_element.ply", 6, 8, OCTAHEDRON),
        ("ply/dup_property_ascii.ply", 6, 8, OCTAHEDRON),
        ("ply/dup_property_bin.ply", 6, 8, OCTAHEDRON),
        ("ply/extra_columns_faces.ply", 6, 8, OCTAHEDRON),
        ("ply/prop_name_hash.ply", 6, 8, OCTAHEDRON),
        ("ply/second_list.ply", 6, 8, OCTAHEDRON),
        ("stl/color_lines.stl", 6, 8, OCTAHEDRON),
        ("stl/endsolid_glued.stl", 6, 8, OCTAHEDRON),
        ("stl/facet_per_line.stl", 6, 8, OCTAHEDRON),
        ("stl/missing_endloop_once.stl", 6, 8, OCTAHEDRON),
    ] {
        let bytes = fixture(&format!("cases/{name}"));
        assert_reads(&bytes, name, vertices, faces, expected);
        // Other line ends change nothing in a text.
        if let Ok(text) = String::from_utf8(bytes)
            && !text.contains('\0')
        {
            assert_reads(
                text.replace('\n', "\r\n").as_bytes(),
                name,
                vertices,
                faces,
                expected,
            );
        }
    }
    assert_refused(
        &fixture("cases/obj/msvc_nan_z.obj"),
        Format::Obj,
        &["vertex 6", "not a finite number"],
    );
    assert_refused(
        &fixture("cases/stl/concatenated_binary_big.stl"),
        Format::Stl,
        &["after its 320 triangles a second STL of 320 triangles begins"],
    );
}

fn obj(vertex_end: &str, face: impl Fn([usize; 3]) -> String) -> String {
    let vertices: String = VERTICES.iter().map(|v| format!("v {v}{vertex_end}\n")).collect();
    let faces: String = FACES.iter().map(|f| face(*f) + "\n").collect();
    vertices + &faces
}

#[test]
fn obj_text_in_every_spelling() {
    assert_octahedron(&obj("", |[a, b, c]| {
        format!("f {}//1 {}/2 {}/2/1", a + 1, b + 1, c + 1)
    }));
    assert_octahedron(&obj("\t# a", |[a, b, c]| {
        format!("f\t{}\t{}\t{}\t", a + 1, b + 1, c + 1)
    }));
    assert_octahedron(&obj(" 1.0", |[a, b, c]| {
        format!("f {} {} {}", a as i64 - 6, b as i64 - 6, c as i64 - 6)
    }));
    assert_octahedron(
        &obj(" 0.1 0.2 0.3#x", |[a, b, c]| {
            format!("f {}/1#{} {}", a + 1, b + 1, c + 1)
        })
        .replace('#', " "),
    );
    assert_octahedron(&obj("#x", |[a, b, c]| {
        format!("f {}/1 {}/1 {}/1# comment", a + 1, b + 1, c + 1)
    }));
    assert_octahedron(&obj(" \\\n", |[a, b, c]| {
        format!("f {} \\\n{}\\\r\n {}", a + 1, b + 1, c + 1)
    }));
    assert_octahedron(&obj("", |[a, b, c]| format!("fo {} {} {}", a + 1, b + 1, c + 1)));
    // The path of a comment does not swallow the next line.
    assert_octahedron(
        &("# C:\\models\\\n".to_owned() + &obj("", |[a, b, c]| format!("f {} {} {}", a + 1, b + 1, c + 1))),
    );
    assert_octahedron(
        &("\u{feff}o Würfel\n".to_owned() + &obj("", |[a, b, c]| format!("f {} {} {}", a + 1, b + 1, c + 1))),
    );
}

#[test]
fn what_is_no_number_is_never_read_as_the_start_of_one() {
    let octahedron = obj("", |[a, b, c]| format!("f {} {} {}", a + 1, b + 1, c + 1));
    for spelled in [
        "1.#IND",
        "-1.#IND00",
        "1.#QNAN",
        "1.#INF",
        "nan(ind)",
        "-nan(snan)",
        "inf",
        "1e999",
    ] {
        let changed = octahedron.replacen("v 1 0 0", &format!("v 1 {spelled} 0"), 1);
        assert_eq!(
            read(changed.as_bytes()).map(|r| r.1),
            Err(MeshError::NotFinite { vertex: 0 }),
            "{spelled}"
        );
        // A vertex of no face may be anywhere.
        for (format, text) in [
            (
                Format::Obj,
                format!("v 7 {spelled} 7\n{octahedron}")
                    .replace("f ", "f -")
                    .to_owned(),
            ),
            (
                Format::Off,
                off("OFF\n7 8 0\n", "").replace("3 0 2 4\n", &format!("{spelled} 0 0\n3 0 2 4\n")),
            ),
            (
                Format::Ply,
                ply("", "", "")
                    .replace("vertex 6", "vertex 7")
                    .replace("3 0 2 4\n", &format!("0 0 {spelled}\n3 0 2 4\n")),
            ),
        ] {
            // Negative indices count from the end, so that the first vertex is in no face.
            let text = if format == Format::Obj {
                negative(&text)
            } else {
                text
            };
            assert_reads(text.as_bytes(), &format!("{format} {spelled}"), 7, 8, OCTAHEDRON);
        }
    }
    assert_reads(
        format!("v 1e99 0 0\n{}", negative(&octahedron.replace("f ", "f -"))).as_bytes(),
        "huge",
        7,
        8,
        OCTAHEDRON,
    );
    for word in ["0x1p3", "1,5", "1.5.2", "1.#", "one"] {
        let changed = octahedron.replacen("v 1 0 0", &format!("v 1 {word} 0"), 1);
        assert_refused(
            changed.as_bytes(),
            Format::Obj,
            &["line 1, `v 1 ", "expected three numbers"],
        );
    }
}

/// Faces `f -a b c` of vertices 1 to 6 as negative indices of as many.
fn negative(text: &str) -> String {
    let line = |line: &str| match line.strip_prefix("f -") {
        Some(corners) => {
            let index = |word: &str| format!(" {}", word.parse::<i64>().expect("an index") - 7);
            "f".to_owned() + &corners.split(' ').map(index).collect::<String>() + "\n"
        }
        None => line.to_owned() + "\n",
    };
    text.lines().map(line).collect()
}

fn off(head: &str, face_end: &str) -> String {
    let vertices: String = VERTICES.iter().map(|v| format!("{v}\n")).collect();
    let faces: String = FACES
        .iter()
        .map(|[a, b, c]| format!("3 {a} {b} {c}{face_end}\n"))
        .collect();
    format!("{head}{vertices}{faces}")
}

#[test]
fn off_is_a_stream_of_words() {
    for head in [
        "OFF\n6 8 12\n",
        "OFF 6\n8\n",
        "OFF\n\n6 8\n12\n# c\n",
        "OFF6 8 0\n",
        "off\n6 8 0\n",
        "6 8 0\n",
    ] {
        if head.starts_with('O') {
            assert_octahedron(&off(head, ""));
        }
        let soup = read_as(off(head, " 255 0 0").as_bytes(), Some(Format::Off))
            .expect(head)
            .1;
        assert_eq!(soup.faces.len(), 8, "{head}");
    }
    // Everything on one line; vertices over several lines; a face over several lines.
    let plain = off("OFF\n6 8 0\n", "");
    assert_octahedron(&plain.replacen('\n', " ", 1000));
    assert_octahedron(&plain.replace(' ', "\n").replacen("6\n8\n0", "6 8 0", 1));
    assert_octahedron(&plain.replace("3 0 2 4", "3\n0 2\n4"));
    assert_octahedron(&plain.replace("3 0 2 4", "3 0 2 # here\n 4"));
    // Numbers after the coordinates, declared or not.
    for (keyword, columns) in [
        ("COFF", " 9 9 9 255"),
        ("NOFF", " 0 0 1"),
        ("CNOFF", " 0 0 1 1 0 0 1"),
        ("NCOFF", " 0 0 1 1 0 0 1"),
        ("STOFF", " 0.5 0.5"),
        ("NSTCOFF", " 0.5 0.5 0 0 1 1 0 0 1"),
        ("4OFF", " 1"),
        ("OFF", " 255 255 255"),
    ] {
        let mut text = format!("{keyword}\n6 8 0\n");
        text += &VERTICES.map(|v| format!("{v}{columns}\n")).concat();
        text += &FACES.map(|[a, b, c]| format!("3 {a} {b} {c}\n")).concat();
        assert_octahedron(&text);
        if keyword != "OFF" {
            assert_octahedron(&text.replacen('\n', " ", 1000));
        }
    }
    let halved = "4OFF\n6 8 0\n".to_owned()
        + &VERTICES.map(|v| v.replace('1', "2") + " 2\n").concat()
        + &FACES.map(|[a, b, c]| format!("3 {a} {b} {c}\n")).concat();
    assert_octahedron(&halved);
    assert_octahedron(&off("nOFF 3\n6 8 0\n", ""));
    assert_octahedron(&off("nOFF\n3\n6 8 0\n", ""));
    assert_refused(
        off("nOFF 4\n6 8 0\n", "").as_bytes(),
        Format::Off,
        &["nOFF of 4 dimensions"],
    );
    // Cut short: words of the colours must not be taken for the next face.
    let cut = off("OFF\n6 8 0\n", " 255 0 0").replace("3 0 3 5 255 0 0\n", "");
    assert_refused(cut.as_bytes(), Format::Off, &["cut short"]);
    assert_refused(b"OFF BINARY\n\0\0\0\x06", Format::Off, &["OFF BINARY"]);
    assert_refused(
        off("OFF\n6 8 0\n", "").replace("3 0 2 4", "3 0 2.5 4").as_bytes(),
        Format::Off,
        &["line 9, `2.5 4`", "a vertex index"],
    );
}

/// An ascii PLY with other header lines at three places.
fn ply(first: &str, vertex: &str, face: &str) -> String {
    let mut text = format!("ply\n{first}format ascii 1.0\nelement vertex 6\n");
    text += &format!("property float x\nproperty float y\nproperty float z\n{vertex}");
    text += &format!("element face 8\nproperty list uchar int vertex_indices\n{face}end_header\n");
    text += &VERTICES.map(|v| format!("{v}\n")).concat();
    text + &FACES.map(|[a, b, c]| format!("3 {a} {b} {c}\n")).concat()
}

#[test]
fn ply_headers_and_rows() {
    let plain = ply("", "", "");
    assert_octahedron(&plain);
    assert_octahedron(&ply(
        "comment end_header\nobj_info # \n",
        "comment\n\n",
        "comment property float q\n",
    ));
    assert_octahedron(&plain.replace("vertex_indices", "Vertex_Index"));
    // A name that only begins like the wanted one.
    assert_octahedron(
        &ply("", "", "property list uchar int vertex_indices_of_hole\n")
            .replace(" 4\n", " 4 2 1 2\n")
            .replace(" 5\n", " 5 0\n"),
    );
    assert_refused(
        plain.replace("vertex_indices", "vertex_ind").as_bytes(),
        Format::Ply,
        &["no list `vertex_indices`"],
    );
    // An element that is declared twice.
    let twice = plain.replace("element vertex 6\nproperty float x\nproperty float y\nproperty float z\n", "element vertex 2\nproperty float x\nproperty float y\nproperty float z\nelement vertex 4\nproperty double z\nproperty double y\nproperty double x\n");
    assert_octahedron(&twice.replace("0 1 0\n0 -1 0\n0 0 1\n0 0 -1\n", "0 1 0\n0 -1 0\n1 0 0\n-1 0 0\n"));
    // Of two properties of one name the first counts.
    assert_octahedron(
        &ply("", "property float x\n", "")
            .replace(" 0\n", " 0 77\n")
            .replace(" 1\n", " 1 77\n")
            .replace(" -1\n", " -1 77\n"),
    );
    // Faces before vertices.
    let cut = ply("", "", "")
        .replace(" 4\n", " 4 255 0\n")
        .replace("3 0 3 5\n", "");
    assert_refused(cut.as_bytes(), Format::Ply, &["cut short"]);
    let (head, body) = plain.split_once("end_header\n").expect("a header");
    let (vertices, faces) = body.split_at(body.find("3 0 2 4").expect("the first face"));
    let swapped = "ply\nformat ascii 1.0\nelement face 8\nproperty list uchar int vertex_indices\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    assert_octahedron(&format!("{swapped}{faces}{vertices}"));
    // Rows: longer than declared, on fewer lines, on more.
    let row_ends = |end: &str| format!("{head}end_header\n{}", body.replace('\n', end));
    for end in [" 7 7\n", " ", "\n\n", " x\n"] {
        assert_octahedron(&row_ends(end));
    }
    assert_octahedron(&format!("{head}end_header\n{}", body.replace(' ', "\n")));
    assert_octahedron(&(plain.clone() + "left over\nby a program\n"));
    assert_refused(
        plain.replace("0 -1 0\n", "0 -1\n").as_bytes(),
        Format::Ply,
        &["line 4 after the header has fewer numbers"],
    );
    assert_refused(
        plain.replace("0 -1 0\n", "0 -1 z\n").as_bytes(),
        Format::Ply,
        &["line 4 after the header, `z`: expected a number"],
    );
    assert_refused(
        plain.replace("3 0 2 4", "3 0 2 4.5").as_bytes(),
        Format::Ply,
        &["face 0", "number 4.5"],
    );
    assert_refused(
        plain
            .replace("property float y\n", "property floats y\n")
            .as_bytes(),
        Format::Ply,
        &["line 5, `property floats y`: not a PLY statement"],
    );
}

fn stl(facet: impl Fn([&str; 3]) -> String) -> String {
    let facets: String = FACES.iter().map(|f| facet(f.map(|k| VERTICES[k]))).collect();
    format!("solid x\n{facets}endsolid x\n")
}

#[test]
fn ascii_stl_in_every_spelling() {
    let plain = stl(|[a, b, c]| {
        format!(
            " facet normal 0 0 1\n  outer loop\n   vertex {a}\n   vertex {b}\n   vertex {c}\n  endloop\n endfacet\n"
        )
    });
    assert_octahedron(&plain);
    for (from, to) in [
        ("endloop", "end loop"),
        ("endfacet", "end  facet"),
        ("endsolid x", "end solid x"),
        ("endsolid x", "endsolid_of_x"),
        ("endsolid x", "ENDSOLID"),
        ("solid x\n f", "solid\n f"),
        ("solid x\n f", "\n \u{feff}solid x\n f"),
        ("solid x\n f", "solid a facet of 2 #3\n f"),
        ("solid x\n f", "solidx\n f"),
        ("outer loop", "outerloop"),
        ("facet normal 0 0 1", "facet"),
        ("facet normal 0 0 1", "facet normal"),
        ("facet normal 0 0 1", "facet normal nan -nan(ind) 1.#QNAN"),
        ("facet normal 0 0 1", "FACET NORMAL 0 0\n1"),
        ("  endloop\n", ""),
        (" endfacet\n", ""),
        ("  endloop\n endfacet\n", ""),
        ("  outer loop\n", ""),
        (" facet n", " color 0.1 0.2 0.3\n facet n"),
        ("  endloop\n", "  endloop\n colour 255 0 0 255\n"),
        ("\n", " "),
        ("\n", "\n\n\t"),
        ("vertex", "vertex\n"),
        ("vertex", "Vertex"),
    ] {
        let changed = plain.replace(from, to).replace(" \u{feff}", "");
        assert_ne!(changed, plain);
        assert_octahedron(&changed);
    }
    // Several solids.
    let half = plain
        .find(" facet")
        .map(|k| plain[k..].match_indices(" facet").nth(4).expect("eight facets").0 + k);
    let (first, second) = plain.split_at(half.expect("facets"));
    assert_octahedron(&format!("{first}endsolid x\nsolid y\n{second}"));
    // A loop of four vertices is a polygon.
    let quads = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 2 1 0\nvertex 0 2 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid\n";
    assert_reads(quads.as_bytes(), "a concave loop", 4, 2, 1.0);

    assert_refused(
        plain.replacen("   vertex 1 0 0\n", "", 1).as_bytes(),
        Format::Stl,
        &["line 2, `facet normal 0 0 1`: a facet of 2 vertices"],
    );
    assert_refused(
        plain.replacen("  outer loop", "  inner loop", 1).as_bytes(),
        Format::Stl,
        &["line 3, `inner loop`: not an STL statement"],
    );
    assert_refused(
        plain.replacen("endsolid x", "", 1).as_bytes(),
        Format::Stl,
        &["without `endsolid`"],
    );
    let text = format!("exported by a program, see its manual for more\n{plain}");
    assert_refused(
        text.as_bytes(),
        Format::Stl,
        &["it begins with `exported by a program", "`solid …`"],
    );
}

#[test]
fn binary_stl_with_something_after_it() {
    let file = crate::encode::binary_stl(b"a");
    let with = |tail: &[u8]| [file.as_slice(), tail].concat();
    assert_eq!(read(&with(&[0; 100])).expect("a short trailer").1.faces.len(), 4);
    // Two and three files, also ones shorter than a trailer may be.
    for tail in [file.clone(), [file.clone(), file.clone()].concat()] {
        let error = read(&with(&tail)).expect_err("two files").to_string();
        assert!(
            error.contains("after its 4 triangles a second STL of 4 triangles begins"),
            "{error}"
        );
    }
    assert_refused(
        &with(&[1; 3000]),
        Format::Stl,
        &["4 triangles, but 3000 bytes follow"],
    );
    let mut none = file.clone();
    none[80..84].fill(0);
    none.extend([0; 1000]);
    assert_refused(&none, Format::Stl, &["0 triangles, but 1200 bytes follow"]);
}

#[test]
fn concave_polygons_in_every_format() {
    let corners = ["0 0 0", "2 0 0", "2 1 0", "1 1 0", "1 2 0", "0 2 0"];
    // The fan around the first corner of the fifth and sixth rotation reaches out of the polygon.
    for first in 0..6 {
        let mut turned = corners;
        turned.rotate_left(first);
        let lines = turned.join("\n");
        let obj = format!("v {}\nf 1 2 3 4 5 6\n", turned.join("\nv "));
        let before = format!("f 1 2 3 4 5 6\nv {}\n", turned.join("\nv "));
        let off = format!("OFF\n6 1 0\n{lines}\n6 0 1 2 3 4 5\n");
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 6\nproperty int x\nproperty int y\nproperty int z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n{lines}\n6 0 1 2 3 4 5\n"
        );
        let stl = format!(
            "solid\nfacet\nouter loop\nvertex {}\nendloop\nendfacet\nendsolid\n",
            turned.join("\nvertex ")
        );
        for text in [obj, off, ply, stl] {
            assert_reads(text.as_bytes(), &text, 6, 4, 3.0);
        }
        let soup = read_as(before.as_bytes(), Some(Format::Obj)).expect("valid").1;
        assert!((area(&soup) - 3.0).abs() < 1e-12);
    }
}

#[test]
fn the_step_of_the_last_digit_is_told() {
    let close = |bytes: &[u8], expected: f64| {
        let (format, soup) = read(bytes).expect("valid");
        let found = soup.resolution;
        assert!(
            (found - expected).abs() <= 1e-9 * expected,
            "{format}: {found}, expected {expected}"
        );
    };
    let fixed = ["0.500000", "12.345678", "0.000000"].join(" ");
    let general = ["0.5", "12.3457", "0"].join(" ");
    for (point, step) in [(fixed, 1e-6), (general, 1e-4), ("1 0 0".into(), 0.0)] {
        close(format!("v {point}\nv 0 0 0\nv 0 1 0\nf 1 2 3\n").as_bytes(), step);
        close(
            format!("OFF\n3 1 0\n{point}\n0 0 0\n0 1 0\n3 0 1 2\n").as_bytes(),
            step,
        );
        close(
            ply("", "", "")
                .replacen("1 0 0\n", &format!("{point}\n"), 1)
                .as_bytes(),
            step,
        );
        close(
            stl(|[a, b, c]| format!("facet\nvertex {a}\nvertex {b}\nvertex {c}\n"))
                .replace("vertex 1 0 0", &format!("vertex {point}"))
                .as_bytes(),
            step,
        );
    }
    // The largest coordinate is 1 in both; 32-bit floats have 23 bits behind it.
    close(&crate::encode::binary_stl(b""), 2f64.powi(-23));
    close(&crate::encode::binary_ply(true), 2f64.powi(-23));
}
