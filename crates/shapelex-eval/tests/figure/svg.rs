//! What every figure has to be.

/// Checks that every tag is closed in order, that attributes are quoted, and that text is escaped; returns the texts.
pub fn well_formed(svg: &str) -> Vec<String> {
    let mut open: Vec<&str> = Vec::new();
    let mut texts = Vec::new();
    let mut rest = svg;
    while let Some(at) = rest.find('<') {
        let text = rest[..at].trim();
        if !text.is_empty() {
            for (i, _) in text.match_indices('&') {
                let entity = &text[i..text[i..].find(';').map_or(i, |end| i + end + 1)];
                assert!(
                    ["&amp;", "&lt;", "&gt;", "&quot;", "&apos;"].contains(&entity),
                    "{text}"
                );
            }
            texts.push(text.to_owned());
        }
        let end = at + rest[at..].find('>').expect("an unclosed tag");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        assert!(!tag.contains('<'), "{tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split([' ', '/']).next().unwrap();
        for attribute in tag.split('"').step_by(2).map(str::trim) {
            let attribute = attribute.trim_start_matches(name).trim();
            assert!(
                attribute.is_empty() || attribute == "/" || attribute.ends_with('='),
                "{tag}"
            );
        }
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    assert!(rest.trim().is_empty(), "{rest}");
    assert!(!svg.contains("NaN") && !svg.contains("inf\""));
    texts
}

/// An attribute of a tag.
fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let rest = &tag[tag.find(&format!(" {name}=\""))? + name.len() + 3..];
    rest.split('"').next()
}

/// Checks that every text begins and ends inside the figure, by Helvetica's mean width of a letter.
pub fn nothing_is_cut(svg: &str) {
    let (_, drawn) = svg.split_once("viewBox=\"0 0 ").unwrap();
    let size: Vec<f64> = drawn
        .split('"')
        .next()
        .unwrap()
        .split(' ')
        .map(|n| n.parse().unwrap())
        .collect();
    let mut seen = 0;
    for piece in svg.split("<text ").skip(1) {
        let (tag, rest) = piece.split_once('>').unwrap();
        let tag = format!(" {tag}");
        let text = rest.split('<').next().unwrap().trim();
        let number = |name: &str| attribute(&tag, name).unwrap().parse::<f64>().unwrap();
        let (x, y) = (number("x"), number("y"));
        let length = 0.5 * number("font-size") * text.chars().count() as f64;
        let before = match attribute(&tag, "text-anchor") {
            Some("middle") => 0.5,
            Some("end") => 1.0,
            _ => 0.0,
        };
        let (from, to) = (-before * length, (1.0 - before) * length);
        let (low, high, limit) = if tag.contains("rotate(270") || tag.contains("rotate(-90") {
            (y - to, y - from, size[1])
        } else {
            (x + from, x + to, size[0])
        };
        assert!(
            low >= -1.0 && high <= limit + 1.0,
            "'{text}' from {low} to {high} of {limit}"
        );
        seen += 1;
    }
    assert!(seen > 0);
}

pub fn says(svg: &str, labels: &[&str]) {
    let texts = well_formed(svg);
    nothing_is_cut(svg);
    for label in labels {
        assert!(texts.iter().any(|t| t == label), "no '{label}' in {texts:?}");
    }
    assert!(svg.starts_with("<svg xmlns="));
    assert!(svg.contains("<title>"));
    save(svg);
}

/// With `SHAPELEX_FIGURES=DIR` the tests leave their figures in DIR, to be looked at.
fn save(svg: &str) {
    let Some(dir) = std::env::var_os("SHAPELEX_FIGURES") else {
        return;
    };
    let title = svg.split("<title>").nth(1).unwrap().split('<').next().unwrap();
    let name: String = title.chars().filter(char::is_ascii_alphanumeric).collect();
    std::fs::write(std::path::Path::new(&dir).join(format!("{name}.svg")), svg).unwrap();
}
