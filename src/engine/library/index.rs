//! Own records as they are searched.

use std::collections::HashMap;

use precut_library::search::{self, fold};

use crate::store::documents::Title;

/// The names, titles and other names of the own records of a kind.
pub(crate) struct Index {
    titles: Vec<Title>,
    search: search::Index,
    /// Names by what they are called, folded.
    called: HashMap<String, Vec<String>>,
    bytes: usize,
}

impl Index {
    /// Of titles, whose words are the title and then other names, a line each.
    pub(crate) fn of(titles: Vec<Title>) -> Self {
        /// What an entry takes beside its letters, which are kept three times.
        const ENTRY: usize = 300;
        let mut search = search::Index::default();
        let mut called: HashMap<String, Vec<String>> = HashMap::new();
        let mut bytes = 0;
        for title in &titles {
            let mut words = title.words.lines();
            let said = words.next().unwrap_or_default();
            search.add(&title.name, said, words.clone());
            let mut folded: Vec<String> = std::iter::once(title.name.as_str()).chain(words).map(fold).collect();
            folded.sort_unstable();
            folded.dedup();
            for name in folded {
                called.entry(name).or_default().push(title.name.clone());
            }
            bytes += ENTRY + 3 * (title.name.len() + title.words.len());
        }
        Self { titles, search, called, bytes }
    }

    /// About what it takes of memory.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    /// Names of the records that are called so, folded.
    pub(crate) fn called(&self, folded: &str) -> &[String] {
        self.called.get(folded).map_or(&[], Vec::as_slice)
    }

    /// Names of the records that a text fits, best first.
    pub(crate) fn find(&self, text: &str) -> Vec<&str> {
        self.search.find(text, self.titles.len())
    }

    /// All of them, by name.
    pub(crate) fn titles(&self) -> &[Title] {
        &self.titles
    }
}
