//! A hash that is the same on every machine and in every version: FNV-1a with 64 bits (Fowler, Noll and Vo; RFC 9923).
//!
//! It tells accidents apart, not forgeries. Two inputs of one length that differ in a single byte never collide, since
//! every step maps the state one to one.

/// The hash of what was fed to it so far.
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

    /// A number, or the length of what follows.
    pub fn number(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    /// The bits of a value.
    pub fn value(&mut self, value: f64) {
        self.number(value.to_bits());
    }

    /// A text with its length.
    pub fn text(&mut self, text: &str) {
        self.number(text.len() as u64);
        self.bytes(text.as_bytes());
    }

    /// Positions with their number.
    pub fn positions(&mut self, positions: &[[f64; 3]]) {
        self.number(positions.len() as u64);
        positions.as_flattened().iter().for_each(|&x| self.value(x));
    }

    /// Groups of indices with their number.
    pub fn indices<const N: usize>(&mut self, groups: &[[u32; N]]) {
        self.number(groups.len() as u64);
        groups.as_flattened().iter().for_each(|&index| self.number(index.into()));
    }

    pub fn sum(self) -> u64 {
        self.0
    }
}

/// The hash of these bytes.
pub(crate) fn sum_of(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.bytes(bytes);
    hash.sum()
}

/// What the first line of a signed text begins with.
const SIGNATURE: &str = "# Written by biotissue; checksum of the lines below: ";

/// A text in which `#` begins a comment, with its hash in a line before it: [`below_signature`] tells whether it was changed.
pub(crate) fn signed(text: &str) -> String {
    format!("{SIGNATURE}{:016x}\n{text}", sum_of(text.as_bytes()))
}

/// The lines below the signature of a text, and whether they are as they were signed; `None` for a text without one.
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
        // From the test vectors of the authors.
        for (text, sum) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut hash = Fnv::new();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.sum(), sum, "{text}");
        }
    }
}
