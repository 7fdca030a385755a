//! FNV-1a hash with 64 bits (Fowler, Noll and Vo; RFC 9923), identical on every machine and in every version.
//!
//! The hash detects accidental changes, not forgeries. Two inputs of equal length that differ in a single byte never
//! collide, since every step maps the state one to one.

/// The hash of all bytes added so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fnv(u64);

impl Fnv {
    pub fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub fn add_bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// Adds an integer, such as a value or the length of the following data.
    pub fn add_u64(&mut self, number: u64) {
        self.add_bytes(&number.to_le_bytes());
    }

    /// Adds the bits of a floating-point value.
    pub fn add_f64(&mut self, value: f64) {
        self.add_u64(value.to_bits());
    }

    /// Adds the length of a text, then its bytes.
    pub fn add_str(&mut self, text: &str) {
        self.add_u64(text.len() as u64);
        self.add_bytes(text.as_bytes());
    }

    /// Adds the number of positions, then their coordinates.
    pub fn add_positions(&mut self, positions: &[[f64; 3]]) {
        self.add_u64(positions.len() as u64);
        positions.as_flattened().iter().for_each(|&x| self.add_f64(x));
    }

    /// Adds the number of groups, then their indices.
    pub fn add_indices<const N: usize>(&mut self, groups: &[[u32; N]]) {
        self.add_u64(groups.len() as u64);
        groups.as_flattened().iter().for_each(|&index| self.add_u64(index.into()));
    }

    pub fn finish(self) -> u64 {
        self.0
    }
}

/// Returns the hash of `bytes`.
pub(crate) fn sum_of(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.add_bytes(bytes);
    hash.finish()
}

/// The beginning of the first line of a text with a checksum.
const CHECKSUM_LINE: &str = "# Written by biotissue; checksum of the lines below: ";

/// Prefixes a text, in which `#` begins a comment, with a line that holds its hash; [`below_checksum`] verifies it.
pub(crate) fn with_checksum(text: &str) -> String {
    format!("{CHECKSUM_LINE}{:016x}\n{text}", sum_of(text.as_bytes()))
}

/// Returns the lines below the checksum and whether they are unchanged since it was computed; `None` for a text without
/// checksum.
pub(crate) fn below_checksum(text: &str) -> Option<(&str, bool)> {
    let (sum, rest) = text.strip_prefix(CHECKSUM_LINE)?.split_once('\n')?;
    Some((rest, u64::from_str_radix(sum, 16) == Ok(sum_of(rest.as_bytes()))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_text_is_detected() {
        let text = "a = 1\nb = 2\n";
        let whole = with_checksum(text);
        assert_eq!(below_checksum(&whole), Some((text, true)));
        assert_eq!(below_checksum(&whole.replace("b = 2", "b = 3")), Some(("a = 1\nb = 3\n", false)));
        assert_eq!(below_checksum(&whole[..whole.len() - 1]), Some(("a = 1\nb = 2", false)));
        assert_eq!((below_checksum(text), below_checksum("")), (None, None));
    }

    #[test]
    fn known_hashes_are_reproduced() {
        // Test vectors of the authors.
        for (text, sum) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut hash = Fnv::new();
            hash.add_bytes(text.as_bytes());
            assert_eq!(hash.finish(), sum, "{text}");
        }
    }
}
