//! Serialization of rows of numbers as one block of bytes, about as fast as copying them.

use std::fmt;
use std::marker::PhantomData;

use bytemuck::Pod;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Rows of numbers of `WORD` bytes each, stored little-endian on every machine.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Raw<T, const WORD: usize>(pub Vec<T>);

/// Converts between the byte order of the machine and that of the file.
fn reorder(bytes: &mut [u8], word: usize) {
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(word).for_each(<[u8]>::reverse);
    }
}

impl<T: Pod, const WORD: usize> Serialize for Raw<T, WORD> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: &[u8] = bytemuck::cast_slice(&self.0);
        if cfg!(target_endian = "little") {
            return serializer.serialize_bytes(bytes);
        }
        let mut bytes = bytes.to_vec();
        reorder(&mut bytes, WORD);
        serializer.serialize_bytes(&bytes)
    }
}

impl<'de, T: Pod, const WORD: usize> Deserialize<'de> for Raw<T, WORD> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_bytes(Bytes(PhantomData))
    }
}

struct Bytes<T, const WORD: usize>(PhantomData<T>);

impl<T: Pod, const WORD: usize> Visitor<'_> for Bytes<T, WORD> {
    type Value = Raw<T, WORD>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rows of {} bytes", size_of::<T>())
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Self::Value, E> {
        if !bytes.len().is_multiple_of(size_of::<T>()) {
            return Err(E::invalid_length(bytes.len(), &self));
        }
        let mut rows: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
        reorder(bytemuck::cast_slice_mut(&mut rows), WORD);
        Ok(Raw(rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_recovered_and_incomplete_ones_rejected() {
        let rows = Raw::<[f64; 3], 8>(vec![[1.0, -2.5, 0.0], [f64::MAX, 1e-300, 3.0]]);
        let bytes = postcard::to_stdvec(&rows).unwrap();
        assert_eq!(bytes.len(), 1 + 48);
        assert_eq!(bytes[1..9], 1.0_f64.to_le_bytes());
        assert_eq!(postcard::from_bytes::<Raw<[f64; 3], 8>>(&bytes).unwrap(), rows);
        // A length of seven is not a multiple of the 24 bytes of a row.
        assert!(postcard::from_bytes::<Raw<[f64; 3], 8>>(&[7, 1, 2, 3, 4, 5, 6, 7]).is_err());
    }
}
