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

    pub fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// Adds an integer, such as a value or the length of the following data.
    pub fn number(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    /// Adds the bits of a floating-point value.
    pub fn value(&mut self, value: f64) {
        self.number(value.to_bits());
    }

    /// Adds the length of a text, then its bytes.
    pub fn text(&mut self, text: &str) {
        self.number(text.len() as u64);
        self.bytes(text.as_bytes());
    }

    /// Adds the number of positions, then their coordinates.
    pub fn positions(&mut self, positions: &[[f64; 3]]) {
        self.number(positions.len() as u64);
        positions.as_flattened().iter().for_each(|&x| self.value(x));
    }

    /// Adds the number of groups, then their indices.
    pub fn indices<const N: usize>(&mut self, groups: &[[u32; N]]) {
        self.number(groups.len() as u64);
        groups.as_flattened().iter().for_each(|&index| self.number(index.into()));
    }

    pub fn sum(self) -> u64 {
        self.0
    }
}

/// Returns the hash of `bytes`.
pub(crate) fn sum_of(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.bytes(bytes);
    hash.sum()
}

/// The beginning of the first line of a signed text.
const SIGNATURE: &str = "# Written by biotissue; checksum of the lines below: ";

/// Prefixes a text, in which `#` begins a comment, with a line that holds its hash; [`below_signature`] verifies it.
pub(crate) fn signed(text: &str) -> String {
    format!("{SIGNATURE}{:016x}\n{text}", sum_of(text.as_bytes()))
}

/// Returns the lines below the signature and whether they are unchanged since signing; `None` for a text without
/// signature.
pub(crate) fn below_signature(text: &str) -> Option<(&str, bool)> {
    let (sum, rest) = text.strip_prefix(SIGNATURE)?.split_once('\n')?;
    Some((rest, u64::from_str_radix(sum, 16) == Ok(sum_of(rest.as_bytes()))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signed_text_that_was_changed_is_known() {
        let text = "a = 1\nb = 2\n";
        let whole = signed(text);
        assert_eq!(below_signature(&whole), Some((text, true)));
        assert_eq!(below_signature(&whole.replace("b = 2", "b = 3")), Some(("a = 1\nb = 3\n", false)));
        assert_eq!(below_signature(&whole[..whole.len() - 1]), Some(("a = 1\nb = 2", false)));
        assert_eq!((below_signature(text), below_signature("")), (None, None));
    }

    #[test]
    fn known_sums_come_out() {
        // Test vectors of the authors.
        for (text, sum) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut hash = Fnv::new();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.sum(), sum, "{text}");
        }
    }
}
