//! Mapping of node tags, which may have gaps, to indices.

use std::collections::HashMap;

/// The node index of each tag.
pub(super) enum Numbering {
    /// Indices by tag, `u32::MAX` for unused tags; chosen for tags without large gaps.
    Dense(Vec<u32>),
    Sparse(HashMap<u64, u32>),
}

impl Numbering {
    /// Maps each tag to its position in the list.
    ///
    /// # Errors
    /// Returns the position of the first duplicate tag.
    pub fn new(tags: impl ExactSizeIterator<Item = u64> + Clone) -> Result<Self, usize> {
        let highest = tags.clone().max().unwrap_or(0);
        let room = 4 * tags.len() as u64 + 1024;
        let mut numbering = if highest < room {
            Self::Dense(vec![u32::MAX; highest as usize + 1])
        } else {
            Self::Sparse(HashMap::new())
        };
        for (index, tag) in tags.enumerate() {
            let here = index as u32;
            let before = match &mut numbering {
                Self::Dense(indices) => std::mem::replace(&mut indices[tag as usize], here),
                Self::Sparse(indices) => indices.insert(tag, here).unwrap_or(u32::MAX),
            };
            if before != u32::MAX {
                return Err(index);
            }
        }
        Ok(numbering)
    }

    /// Returns the index of the node with this tag.
    pub fn index(&self, tag: u64) -> Option<u32> {
        match self {
            Self::Dense(indices) => {
                let index = usize::try_from(tag).ok().and_then(|tag| indices.get(tag));
                index.copied().filter(|&index| index != u32::MAX)
            }
            Self::Sparse(indices) => indices.get(&tag).copied(),
        }
    }
}
