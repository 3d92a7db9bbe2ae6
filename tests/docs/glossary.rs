//! The words of `docs/glossary.md`: each is used, and none that it says not to use is.

use std::path::Path;

use crate::markdown::documents;
use crate::root;

const GLOSSARY: &str = "docs/glossary.md";
/// Where decisions are told, others' words are theirs.
const DECISIONS: &str = "docs/decisions/";

/// Documents and English texts, by name, in small letters.
fn texts() -> Vec<(String, String)> {
    let of_documents = documents(root()).into_iter().map(|document| document.name);
    let folder = std::fs::read_dir(root().join("locales/en")).unwrap();
    let of_locales = folder.map(|entry| format!("locales/en/{}", entry.unwrap().file_name().to_string_lossy()));
    of_documents
        .chain(of_locales)
        .filter(|name| name != GLOSSARY && !name.starts_with(DECISIONS) && Path::new(name).extension().is_some())
        .map(|name| {
            let text = std::fs::read_to_string(root().join(&name)).unwrap().to_lowercase();
            (name, text)
        })
        .collect()
}

/// Whether a text has a word, or its plural, by itself.
fn has(text: &str, word: &str) -> bool {
    text.match_indices(word).any(|(at, _)| {
        let ends = |c: char| !c.is_alphanumeric() && c != '_';
        let after = &text[at + word.len()..];
        let after = after.strip_prefix('s').unwrap_or(after);
        text[..at].chars().next_back().is_none_or(ends) && after.chars().next().is_none_or(ends)
    })
}

#[test]
fn every_word_is_used_and_none_that_is_ruled_out_is() {
    let texts = texts();
    let glossary = std::fs::read_to_string(root().join(GLOSSARY)).unwrap();
    let rows = glossary.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| word |"));
    let mut count = 0;
    for row in rows {
        let [word, meaning, ruled_out] =
            row.trim_matches('|').splitn(3, '|').map(str::trim).collect::<Vec<_>>().try_into().unwrap();
        assert!(!meaning.is_empty(), "{word} means nothing");
        assert!(texts.iter().any(|(_, text)| has(text, word)), "{word} is used nowhere");
        for other in ruled_out.split(',').map(str::trim).filter(|other| !other.is_empty()) {
            let used = texts.iter().find(|(_, text)| has(text, other));
            assert!(used.is_none(), "{:?} says {other:?}: the word is {word:?}", used.map(|(name, _)| name));
        }
        count += 1;
    }
    assert!(count >= 40, "{count} words");
}

#[test]
fn a_word_is_found_by_itself_alone() {
    assert!(has("two lobes, and a lobe", "lobe") && !has("globes and lobe_order", "lobe"));
}
