use super::*;

#[test]
fn numbers_and_integers_stop_where_they_should() {
    let mut s = Scanner::new(b"  1.5e3\t-2/3 +7 x 123456789012345678901\n# c\n\n nan 4#");
    assert_eq!(s.number(), Some(1500.0));
    assert_eq!(s.integer(), Some(-2));
    assert_eq!(s.word(), b"/3");
    assert_eq!(s.integer(), Some(7));
    assert_eq!(s.integer(), None);
    assert_eq!(s.word(), b"x");
    assert_eq!(s.integer(), None);
    s.word();
    assert!(s.line_done());
    assert!(s.next_content());
    assert_eq!(s.line_number(), 4);
    assert!(s.number().is_some_and(f64::is_nan));
    assert_eq!(s.number(), Some(4.0));
    assert!(s.line_done());
    assert!(!s.next_content());
}

#[test]
fn a_number_with_letters_after_it_is_none() {
    for text in [
        "12abc",
        "",
        "0x1p3",
        "1,5",
        "1.5.2",
        "1.#",
        "1.# comment",
        "2.#IND",
        "nan(",
        "--1",
        "1e5f",
    ] {
        assert_eq!(Scanner::new(text.as_bytes()).number(), None, "{text}");
    }
    assert_eq!(Scanner::new(b"-").integer(), None);
    assert_eq!(Scanner::new(b"12abc").whole_integer(), None);
    assert_eq!(Scanner::new("9".repeat(5000).as_bytes()).number(), None);
}

#[test]
fn c_libraries_spell_what_is_not_finite_in_many_ways() {
    for text in [
        "nan",
        "-NaN",
        "nan(ind)",
        "-nan(snan)",
        "NAN(0x7)",
        "1.#IND",
        "-1.#IND00",
        "1.#QNAN",
        "1.#SNAN",
        "-1.#INF",
        "1.#J",
        "inf",
        "-Infinity",
    ] {
        let padded = format!("{text} 7");
        let mut scan = Scanner::new(padded.as_bytes());
        assert!(scan.number().is_some_and(|x| !x.is_finite()), "{text}");
        assert_eq!(scan.number(), Some(7.0), "{text}");
    }
}

#[test]
fn a_backslash_continues_a_line_but_not_a_comment() {
    let text = b"f 1 2\\\n3 \\\r\n4\n# c:\\\nv\\\r1\\";
    let mut s = Scanner::new(text).with_continued_lines();
    assert_eq!(s.word(), b"f");
    for k in 1..5 {
        assert!(!s.line_done());
        assert_eq!(s.integer(), Some(k));
    }
    assert!(s.line_done());
    assert!(s.next_content());
    assert_eq!(s.word(), b"v");
    assert_eq!(s.number(), Some(1.0));
    assert!(s.line_done());
    let mut s = Scanner::new(text).with_continued_lines();
    s.next_line();
    assert_eq!(s.excerpt(), "# c:\\");
    assert_eq!(Scanner::new(b"\n#a\n b\r\nc").content_lines(9), 2);
}

#[test]
fn a_stopped_text_ends() {
    let cancel = Cancel::new();
    cancel.cancel();
    let text = [b' '; 2 * BLOCK];
    let mut scan = Scanner::new(&text).stopped_by(&cancel);
    scan.next_line();
    assert!(scan.at_end());
    let mut scan = Scanner::new(&text).stopped_by(&cancel);
    assert!(!scan.skip_whitespace());
}
