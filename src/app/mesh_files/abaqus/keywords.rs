//! The blocks of an input file: a keyword with parameters, and lines of data.

/// A keyword and the data below it.
pub(super) struct Block<'a> {
    /// In upper case, with one blank between words.
    pub keyword: String,
    /// The line of the keyword, from 1.
    pub line: usize,
    parameters: Vec<(String, &'a str)>,
    /// Lines, from 1, with the words between commas.
    pub data: Vec<(usize, Vec<&'a str>)>,
}

impl<'a> Block<'a> {
    /// Returns the value of a parameter, without quotes.
    pub fn parameter(&self, key: &str) -> Option<&'a str> {
        let found = self.parameters.iter().find(|(name, value)| name == key && !value.is_empty());
        found.map(|(_, value)| *value)
    }

    /// Returns true if there is a parameter, with or without value.
    pub fn has(&self, key: &str) -> bool {
        self.parameters.iter().any(|(name, _)| name == key)
    }

    fn add_parameters(&mut self, words: impl Iterator<Item = &'a str>) {
        for word in words.map(str::trim).filter(|word| !word.is_empty()) {
            let (key, value) = word.split_once('=').unwrap_or((word, ""));
            self.parameters.push((upper(key), value.trim().trim_matches('"')));
        }
    }
}

/// Returns the blocks of a file, without comments.
pub(super) fn blocks(text: &str) -> Vec<Block<'_>> {
    let mut blocks: Vec<Block<'_>> = Vec::new();
    let mut is_continued = false;
    for (line, text) in (1..).zip(text.lines()).map(|(line, text)| (line, text.trim())) {
        if text.is_empty() || text.starts_with("**") {
            continue;
        }
        if let Some(text) = text.strip_prefix('*') {
            let mut words = text.split(',');
            let keyword = upper(words.next().unwrap_or_default());
            let mut block = Block { keyword, line, parameters: Vec::new(), data: Vec::new() };
            block.add_parameters(words);
            blocks.push(block);
            is_continued = text.ends_with(',');
        } else if let Some(block) = blocks.last_mut() {
            if std::mem::take(&mut is_continued) {
                block.add_parameters(text.split(','));
                is_continued = text.ends_with(',');
            } else {
                block.data.push((line, text.split(',').map(|word| word.trim().trim_matches('"')).collect()));
            }
        }
    }
    blocks
}

fn upper(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_uppercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keywords_have_parameters_and_data() {
        let text =
            "** a comment\n*Solid  section, elset=\"Soft part\",\n material=m\n1.,\n*Node\n 1, 0., 1.\n** 2\n\n3,4\n";
        let blocks = blocks(text);
        let [section, node] = &blocks[..] else { panic!("{}", blocks.len()) };
        assert_eq!((&*section.keyword, section.line), ("SOLID SECTION", 2));
        assert_eq!([section.parameter("ELSET"), section.parameter("MATERIAL")], [Some("Soft part"), Some("m")]);
        assert!(section.has("ELSET") && !section.has("NAME"));
        assert_eq!(section.data, [(4, vec!["1.", ""])]);
        assert_eq!(node.data, [(6, vec!["1", "0.", "1."]), (9, vec!["3", "4"])]);
    }
}
