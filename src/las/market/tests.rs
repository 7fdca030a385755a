use std::path::Path;

use super::read::triplets;

fn entries(text: &str) -> Vec<(u32, u32, f64)> {
    triplets(Path::new("a.mtx"), text.as_bytes()).unwrap_or_else(|error| panic!("{error}")).entries
}

#[test]
fn every_kind_of_file_is_read() {
    type Read = &'static [(u32, u32, f64)];
    let cases: [(&str, Read); 6] = [
        ("real general\n% a comment\n\n2 3 2\n1 3 -1.5e-3\n2 1 4\n", &[(0, 2, -1.5e-3), (1, 0, 4.0)]),
        ("integer symmetric\n2 2 2\n1 1 7\n2 1 3\n", &[(0, 0, 7.0), (1, 0, 3.0), (0, 1, 3.0)]),
        ("real skew-symmetric\n2 2 1\n2 1 3\n", &[(1, 0, 3.0), (0, 1, -3.0)]),
        ("pattern general\n1 2 1\n1 2\n", &[(0, 1, 1.0)]),
        ("real general\n0 0 0\n", &[]),
        ("REAL General\n1 1 2\n1 1 1\n1 1 2\n", &[(0, 0, 1.0), (0, 0, 2.0)]),
    ];
    for (text, expected) in cases {
        assert_eq!(entries(&format!("%%MatrixMarket matrix coordinate {text}")), expected, "{text}");
    }
    assert_eq!(entries("\u{feff}%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n"), [(0, 0, 1.0)]);
    let array = "%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n4\n";
    assert_eq!(entries(array), [(0, 0, 1.0), (1, 0, 2.0), (0, 1, 3.0), (1, 1, 4.0)]);
    let array = "%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3\n";
    assert_eq!(entries(array), [(0, 0, 1.0), (1, 0, 2.0), (0, 1, 2.0), (1, 1, 3.0)]);
}

#[test]
fn broken_files_are_refused_with_line_and_cure() {
    let banner = "%%MatrixMarket matrix coordinate real general\n";
    let cases = [
        (String::new(), "a.mtx:1: no Matrix Market banner"),
        ("%%MatrixMarket matrix coordinate complex general\n".into(), "a.mtx:1: a complex matrix"),
        ("%%MatrixMarket matrix coordinate real sideways\n".into(), "a.mtx:1: the symmetry `sideways`"),
        ("%%MatrixMarket matrix array pattern general\n".into(), "a.mtx:1: the field `pattern`"),
        (banner.into(), "a.mtx:1: the file ends here"),
        (format!("{banner}2 2\n"), "a.mtx:2: `2 2`"),
        (format!("{banner}2 2 1 1\n"), "a.mtx:2: `2 2 1 1`"),
        (format!("{banner}2 -2 1\n"), "a.mtx:2: `2 -2 1`"),
        (format!("{banner}2 2 99999999999999\n1 1 1\n"), "a.mtx:3: the file ends here"),
        (format!("{banner}99999999999 2 1\n"), "a.mtx:2: `99999999999 2 1`"),
        (format!("{banner}2 2 1\n% c\n3 1 1.0\n"), "a.mtx:4: `3 1 1.0`"),
        (format!("{banner}2 2 1\n0 1 1.0\n"), "a.mtx:3: `0 1 1.0`"),
        (format!("{banner}2 2 1\n1.5 1 1.0\n"), "a.mtx:3: `1.5 1 1.0`"),
        (format!("{banner}2 2 1\n1 1 nan\n"), "a.mtx:3: `1 1 nan`"),
        (format!("{banner}2 2 1\n1 1 one\n"), "a.mtx:3: `1 1 one`"),
        (format!("{banner}2 2 1\n1 1 1 1\n"), "a.mtx:3: `1 1 1 1`"),
        ("%%MatrixMarket matrix coordinate real symmetric\n2 3 0\n".into(), "a.mtx:2: `2 3 0`"),
        ("%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n1 1 1\n".into(), "a.mtx:3: `1 1 1`"),
    ];
    for (text, begins) in cases {
        let error = triplets(Path::new("a.mtx"), text.as_bytes()).unwrap_err().to_string();
        assert!(error.starts_with(begins) && error.contains("\n  cure: "), "{text}: {error}");
    }
    assert!(triplets(Path::new("a.mtx"), &[0x1f, 0x8b]).unwrap_err().to_string().contains("is not text"));
}
