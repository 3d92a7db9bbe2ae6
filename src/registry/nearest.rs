//! Which known name was probably meant.

/// Below this similarity (Jaro-Winkler, 0 to 1) a name is another one, not a slip.
const ALIKE: f64 = 0.8;
/// Nothing is called by a name longer than this, bytes; to compare takes time and memory by its length.
const LONGEST: usize = 256;

/// The known name most like `name`, if one is like it at all.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > LONGEST {
        return None;
    }
    let name = name.to_lowercase();
    known
        .map(|known| (strsim::jaro_winkler(&name, known), known))
        .filter(|(alike, _)| *alike >= ALIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_finds_its_name_and_another_word_none() {
        let known = ["diameter_mm", "length_mm", "feed_mm_per_rev"];
        assert_eq!(nearest("lenght_mm", known.into_iter()), Some("length_mm"));
        assert_eq!(nearest("Diameter", known.into_iter()), Some("diameter_mm"));
        assert_eq!(nearest("colour", known.into_iter()), None);
    }
}
