//! Reading of network files that are damaged at any byte.

use std::fs::File;
use std::io::{Seek, Write};
use std::path::Path;

use biotissue::fiber::network::file;

/// A file that is overwritten in place, because creating a new file every time is slow on some disks.
struct Rewritten(File);

impl Rewritten {
    fn new(path: &Path) -> Self {
        Self(File::options().write(true).open(path).unwrap())
    }

    /// Overwrites this file, which is `network` or a file beside it, with `bytes`; returns the fibers that are then
    /// read, or `None` if reading fails.
    fn fibers(&mut self, bytes: &[u8], network: &Path) -> Option<Vec<[u32; 2]>> {
        self.0.rewind().unwrap();
        self.0.write_all(bytes).unwrap();
        self.0.set_len(bytes.len() as u64).unwrap();
        file::read(network).ok().map(|read| read.network.fibers().to_vec())
    }
}

/// No damage may cause a panic, and files that are cut off must be detected.
#[test]
fn damaged_files_cause_no_panic() {
    let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks");
    let folder = tempfile::tempdir().unwrap();
    let [network, params] = ["frozen.txt", "frozen.txt.params"].map(|name| {
        std::fs::copy(frozen.join(name), folder.path().join(name)).unwrap();
        folder.path().join(name)
    });
    let (text, materials) = (std::fs::read(&network).unwrap(), std::fs::read(&params).unwrap());
    let mut rewritten = Rewritten::new(&network);
    let whole = rewritten.fibers(&text, &network);
    assert!(whole.is_some());
    for end in 0..text.len() - 1 {
        // A file cut within the last number may be valid, but it is not the same network.
        assert_ne!(rewritten.fibers(&text[..end], &network), whole, "cut at {end}");
    }
    for (at, flip) in (0..text.len()).flat_map(|at| [0x01, 0x10, 0x80].map(|flip| (at, flip))) {
        let mut damaged = text.clone();
        damaged[at] ^= flip;
        rewritten.fibers(&damaged, &network);
    }
    assert_eq!(rewritten.fibers(&text, &network), whole);
    let mut rewritten = Rewritten::new(&params);
    for end in 0..materials.len() - 2 {
        assert_eq!(rewritten.fibers(&materials[..end], &network), None, "cut at {end}");
    }
    for (at, bit) in (0..materials.len()).flat_map(|at| (0..8).map(move |bit| (at, bit))) {
        let mut damaged = materials.clone();
        damaged[at] ^= 1 << bit;
        rewritten.fibers(&damaged, &network);
    }
}
