//! Numbers in the page: base64 of integers, and of real numbers rounded to 16 bits.

use serde::Serialize;

/// The code of a number that is not finite.
const MISSING: u16 = u16::MAX;

/// Real numbers in groups of `low.len()` components, each rounded to one of 65 535 equally spaced numbers between the
/// smallest and the largest value of its component.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Packed {
    low: Vec<f32>,
    high: Vec<f32>,
    data: String,
}

/// Packs groups of `N` numbers.
pub(super) fn pack<const N: usize>(values: &[[f64; N]]) -> Packed {
    let (mut low, mut high) = ([f64::INFINITY; N], [f64::NEG_INFINITY; N]);
    for value in values {
        for k in (0..N).filter(|&k| value[k].is_finite()) {
            (low[k], high[k]) = (low[k].min(value[k]), high[k].max(value[k]));
        }
    }
    for k in 0..N {
        if low[k] > high[k] {
            (low[k], high[k]) = (0.0, 0.0);
        }
    }
    let code = |value: f64, k: usize| {
        let span = high[k] - low[k];
        let part = if span > 0.0 { (value - low[k]) / span } else { 0.0 };
        if value.is_finite() { (part * f64::from(MISSING - 1)).round() as u16 } else { MISSING }
    };
    let bytes: Vec<u8> = values.iter().flat_map(|value| (0..N).flat_map(|k| code(value[k], k).to_le_bytes())).collect();
    Packed { low: low.map(|x| x as f32).into(), high: high.map(|x| x as f32).into(), data: base64(&bytes) }
}

/// Packs single numbers.
pub(super) fn pack_scalars(values: &[f64]) -> Packed {
    pack(values.as_chunks::<1>().0)
}

/// Returns integers in 32 bits, little endian, as base64.
pub(super) fn integers(values: impl IntoIterator<Item = u32>) -> String {
    base64(&values.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>())
}

/// Returns signed bytes as base64.
pub(super) fn signed_bytes(values: impl IntoIterator<Item = i8>) -> String {
    base64(&values.into_iter().map(i8::cast_unsigned).collect::<Vec<u8>>())
}

/// Encodes bytes as base64 (RFC 4648, with padding).
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |k: usize| u32::from(group.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= group.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        let encoded = [&b""[..], b"f", b"fo", b"foo", b"foob"].map(base64);
        assert_eq!(encoded, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]);
    }

    #[test]
    fn numbers_are_rounded_between_their_extremes() {
        let packed = pack_scalars(&[-2.0, f64::NAN, 2.0, 0.0]);
        assert_eq!((packed.low[0], packed.high[0]), (-2.0, 2.0));
        // The codes 0, 65535, 65534 and 32767.
        assert_eq!(packed.data, base64(&[0, 0, 255, 255, 254, 255, 255, 127]));
        assert_eq!(pack_scalars(&[3.0, 3.0]).data, base64(&[0; 4]));
        assert_eq!(pack(&[[1.0, f64::NAN]]).high, [1.0, 0.0]);
    }
}
