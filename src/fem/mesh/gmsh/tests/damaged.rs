//! Damaged files cause errors, never panics, and a damaged count never determines the size of an allocation.

use super::super::{Version, WriteOptions, to_writer};
use super::{TEXT_2, TEXT_4, read};
use crate::fem::mesh::shapes::cuboid;

fn files() -> Vec<Vec<u8>> {
    let mesh = cuboid([1, 1, 1], [1.0, 2.0, 3.0]).unwrap();
    let binary = [Version::V2_2, Version::V4_1].map(|version| {
        let mut bytes = Vec::new();
        to_writer(&mut bytes, &mesh, WriteOptions { version, binary: true }).unwrap();
        bytes
    });
    let [two, four] = binary;
    vec![TEXT_2.into(), TEXT_4.into(), two, four]
}

#[test]
fn a_file_cut_off_at_any_byte_is_an_error() {
    for bytes in files() {
        let whole = read(&bytes).unwrap();
        let whole_without_break = bytes.len() - 1;
        for end in 0..bytes.len() {
            match read(&bytes[..end]) {
                Ok(file) => {
                    assert!(end == whole_without_break && file == whole, "cut at byte {end} of {}", bytes.len())
                }
                Err(error) => {
                    assert!(!error.problem.is_empty() && !error.expected.is_empty() && !error.cure.is_empty())
                }
            }
        }
    }
}

#[test]
fn a_change_of_any_byte_causes_no_panic() {
    for bytes in files() {
        for at in 0..bytes.len() {
            for change in [0x01, 0x10, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] ^= change;
                // Some changes result in another valid mesh.
                let _ = read(&damaged);
            }
            for byte in [b'\n', b' ', b'$', b'9', b'-', 0, 0x7f] {
                let mut damaged = bytes.clone();
                damaged[at] = byte;
                let _ = read(&damaged);
            }
        }
    }
}

#[test]
fn huge_counts_are_errors() {
    let huge = "1000000000000000000";
    for (text, counts) in [
        (TEXT_2, &["Names\n2\n", "$Nodes\n4\n", "$Elements\n2\n", "\n2 4 2 "][..]),
        (TEXT_4, &["Names\n2\n", "0 0 1 1\n", "\n2 4 10", "2 5 0 3\n", "\n2 2 1 2", "2 5 2 1\n", "1 1 1 5\n"][..]),
    ] {
        for piece in counts {
            // Replaces each number of the piece in turn.
            for (start, _) in piece.match_indices(|c: char| c.is_ascii_digit()) {
                let mut changed = (*piece).to_owned();
                changed.replace_range(start..=start, huge);
                let text = super::with(text, piece, &changed);
                assert!(read(&text).is_err() || changed.contains("10"), "{changed:?}");
            }
        }
    }
}
