//! Truncated files and files with a changed byte give an error or a case, but never a panic.

use super::{FULL, Folder};

/// Reads the damaged text. If it is rejected, there is at least one error, and the errors are in the order of existing
/// lines.
fn check_damaged(folder: &Folder, bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Err(errors) = folder.parse(text) {
        assert!(!errors.0.is_empty(), "refused without a reason:\n{text}");
        assert!(errors.0.is_sorted_by_key(|error| error.line));
        let last = 1 + text.matches('\n').count();
        assert!(errors.0.iter().all(|error| error.line.is_none_or(|line| (1..=last).contains(&line))), "{errors}");
    }
}

#[test]
fn truncated_file_never_panics() {
    let folder = Folder::new();
    for end in 0..FULL.len() {
        check_damaged(&folder, &FULL.as_bytes()[..end]);
    }
}

#[test]
fn file_with_a_changed_byte_never_panics() {
    let folder = Folder::new();
    let mut bytes = FULL.as_bytes().to_vec();
    for at in 0..bytes.len() {
        let good = bytes[at];
        for bad in [good ^ 1, good ^ 2, good ^ 16, b'"', b'\n', b'[', b'-', b'9', 0] {
            bytes[at] = bad;
            check_damaged(&folder, &bytes);
        }
        bytes[at] = good;
    }
}

#[test]
fn file_without_a_line_never_panics() {
    let folder = Folder::new();
    let lines: Vec<&str> = FULL.lines().collect();
    for left_out in 0..lines.len() {
        let mut rest = lines.clone();
        rest.remove(left_out);
        check_damaged(&folder, rest.join("\n").as_bytes());
        let mut twice = lines.clone();
        twice.insert(left_out, lines[left_out]);
        check_damaged(&folder, twice.join("\r\n").as_bytes());
    }
}
