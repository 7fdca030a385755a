//! Messages: plain data in memory aligned to eight bytes.

use bytemuck::{AnyBitPattern, NoUninit};

/// An owned buffer of plain data. It is stored in words of eight bytes, so that it can be viewed without a copy as any
/// type whose alignment is at most eight bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Message {
    words: Vec<u64>,
    /// Length in bytes.
    len: usize,
}

const WORD: usize = size_of::<u64>();

impl Message {
    /// Creates an empty message.
    pub const fn new() -> Self {
        Self { words: Vec::new(), len: 0 }
    }

    /// Creates a message of `len` zero bytes.
    pub fn zeros(len: usize) -> Self {
        Self { words: vec![0; len.div_ceil(WORD)], len }
    }

    /// Copies `values` into a message.
    pub fn of<T: NoUninit>(values: &[T]) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let mut message = Self::zeros(bytes.len());
        message.bytes_mut().copy_from_slice(bytes);
        message
    }

    /// Copies a text into a message.
    pub fn text(text: &str) -> Self {
        Self::of(text.as_bytes())
    }

    /// Joins messages into one, which [`split`](Self::split) separates again. The first message keeps its buffer if the
    /// capacity suffices, so that a single long message is not copied.
    pub fn join(parts: Vec<Self>) -> Self {
        // The lengths follow the messages, so that the first message need not move.
        let trailer = parts.iter().map(|part| part.len as u64).chain([parts.len() as u64]).collect::<Vec<_>>();
        let mut parts = parts.into_iter();
        let mut words = parts.next().unwrap_or_default().words;
        parts.for_each(|part| words.extend_from_slice(&part.words));
        words.extend(trailer);
        Self { len: WORD * words.len(), words }
    }

    /// Returns the parts of a message made by [`join`](Self::join), without copies; `None` if the message does not have
    /// that form.
    pub fn split(&self) -> Option<Vec<&[u8]>> {
        let (&count, rest) = self.values::<u64>()?.split_last()?;
        let parts = rest.len().checked_sub(usize::try_from(count).ok()?)?;
        let (mut rest, lens) = rest.split_at(parts);
        let parts = lens.iter().map(|&len| {
            let len = usize::try_from(len).ok()?;
            let (part, behind) = rest.split_at_checked(len.div_ceil(WORD))?;
            rest = behind;
            Some(&bytemuck::cast_slice(part)[..len])
        });
        let parts = parts.collect::<Option<_>>()?;
        rest.is_empty().then_some(parts)
    }

    /// Returns the length in bytes.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if the message is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Changes the length and fills new bytes with zeros. Keeps the buffer if its capacity suffices.
    pub fn resize(&mut self, len: usize) {
        self.words.resize(len.div_ceil(WORD), 0);
        let kept = self.len.min(len);
        // Clears the bytes behind the remaining ones in the last word kept.
        bytemuck::cast_slice_mut::<_, u8>(&mut self.words)[kept..kept.next_multiple_of(WORD)].fill(0);
        self.len = len;
    }

    /// Returns the bytes.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }

    /// Returns the bytes for modification.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.len]
    }

    /// Returns the content as values of type `T`; `None` if the length is not a multiple of the size of `T`, or if `T`
    /// needs an alignment of more than eight bytes.
    pub fn values<T: AnyBitPattern>(&self) -> Option<&[T]> {
        bytemuck::try_cast_slice(self.bytes()).ok()
    }

    /// Returns the content as values of type `T` for modification; `None` in the same cases as
    /// [`values`](Self::values).
    pub fn values_mut<T: AnyBitPattern + NoUninit>(&mut self) -> Option<&mut [T]> {
        bytemuck::try_cast_slice_mut(self.bytes_mut()).ok()
    }

    /// Returns the content as text; invalid UTF-8 is replaced.
    pub fn to_text(&self) -> String {
        String::from_utf8_lossy(self.bytes()).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_recovered_from_a_message() {
        let message = Message::of(&[1.5_f64, -2.0]);
        assert_eq!(message.values::<f64>(), Some(&[1.5, -2.0][..]));
        assert_eq!(message.len(), 16);
        assert_eq!(Message::of(&[1_u8, 2, 3]).values::<u16>(), None);
        assert_eq!(Message::text("three").to_text(), "three");
        assert_eq!(Message::new().values::<f64>(), Some(&[][..]));
    }

    #[test]
    fn joined_messages_can_be_split() {
        let parts = [Message::text("three"), Message::new(), Message::of(&[1.5_f64])];
        let joined = Message::join(parts.to_vec());
        assert_eq!(joined.split(), Some(parts.iter().map(Message::bytes).collect()));
        assert_eq!(Message::join(Vec::new()).split(), Some(Vec::new()));
        for broken in [&[][..], &[0, 2], &[8, 1], &[0, 0], &[u64::MAX]] {
            assert_eq!(Message::of(broken).split(), None, "{broken:?}");
        }
    }

    #[test]
    fn resizing_fills_with_zeros() {
        let mut message = Message::of(&[0xff_u8; 13]);
        message.resize(3);
        message.resize(11);
        assert_eq!(message.bytes()[..3], [0xff; 3]);
        assert_eq!(message.len(), 11);
        assert_eq!(message.bytes()[3..], [0; 8]);
        assert_eq!(message, Message::of(&[0xff, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0, 0_u8]));
    }
}
