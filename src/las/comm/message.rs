//! Messages: plain data in memory that fits every number of eight bytes.

use bytemuck::{AnyBitPattern, NoUninit};

/// Plain data, owned. Kept in words of eight bytes, so that it can be looked at as any type that asks for no more than that,
/// without copying it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Message {
    words: Vec<u64>,
    /// In bytes.
    len: usize,
}

const WORD: usize = size_of::<u64>();

impl Message {
    /// Nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { words: Vec::new(), len: 0 }
    }

    /// `len` bytes, all zero.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        Self { words: vec![0; len.div_ceil(WORD)], len }
    }

    /// A copy of values.
    #[must_use]
    pub fn of<T: NoUninit>(values: &[T]) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let mut message = Self::zeros(bytes.len());
        message.bytes_mut().copy_from_slice(bytes);
        message
    }

    /// A text.
    #[must_use]
    pub fn text(text: &str) -> Self {
        Self::of(text.as_bytes())
    }

    /// Messages in one, which [`split`](Self::split) takes apart. The first keeps its memory if there is room: a long message
    /// that is joined with no others is not copied.
    #[must_use]
    pub fn join(parts: Vec<Self>) -> Self {
        // Behind the messages, so that the first one need not move.
        let trailer = parts.iter().map(|part| part.len as u64).chain([parts.len() as u64]).collect::<Vec<_>>();
        let mut parts = parts.into_iter();
        let mut words = parts.next().unwrap_or_default().words;
        parts.for_each(|part| words.extend_from_slice(&part.words));
        words.extend(trailer);
        Self { len: WORD * words.len(), words }
    }

    /// What [`join`](Self::join) joined, without copies; `None` where this is no such message.
    #[must_use]
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

    /// How many bytes it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Gives it another length; what is new is zero. Keeps its memory.
    pub fn resize(&mut self, len: usize) {
        self.words.resize(len.div_ceil(WORD), 0);
        let kept = self.len.min(len);
        // What stood behind the bytes that stay, in the same word.
        bytemuck::cast_slice_mut::<_, u8>(&mut self.words)[kept..kept.next_multiple_of(WORD)].fill(0);
        self.len = len;
    }

    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }

    /// Its bytes, for writing.
    #[must_use]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.len]
    }

    /// Its values; `None` where its length is no whole number of them, or they ask for more than words of eight bytes.
    #[must_use]
    pub fn values<T: AnyBitPattern>(&self) -> Option<&[T]> {
        bytemuck::try_cast_slice(self.bytes()).ok()
    }

    /// Its values, for writing.
    #[must_use]
    pub fn values_mut<T: AnyBitPattern + NoUninit>(&mut self) -> Option<&mut [T]> {
        bytemuck::try_cast_slice_mut(self.bytes_mut()).ok()
    }

    /// Its text, what is no text replaced.
    #[must_use]
    pub fn to_text(&self) -> String {
        String::from_utf8_lossy(self.bytes()).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_as_they_went() {
        let message = Message::of(&[1.5_f64, -2.0]);
        assert_eq!(message.values::<f64>(), Some(&[1.5, -2.0][..]));
        assert_eq!(message.len(), 16);
        assert_eq!(Message::of(&[1_u8, 2, 3]).values::<u16>(), None);
        assert_eq!(Message::text("three").to_text(), "three");
        assert_eq!(Message::new().values::<f64>(), Some(&[][..]));
    }

    #[test]
    fn joined_messages_come_apart() {
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
