//! The languages that the service speaks, and which of them a client wants.

/// A language that the service speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Language {
    /// English.
    #[default]
    En,
    /// Russian.
    Ru,
}

impl Language {
    /// All of them, the default first.
    pub const ALL: [Self; 2] = [Self::En, Self::Ru];

    /// As in `Content-Language`.
    pub const fn tag(self) -> &'static str {
        match self {
            Self::En => "en",
            Self::Ru => "ru",
        }
    }

    /// The language of that tag.
    pub fn of_tag(tag: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|language| language.tag() == tag)
    }

    /// Between whole and decimals of a number in a sentence.
    pub const fn decimal(self) -> char {
        match self {
            Self::En => '.',
            Self::Ru => ',',
        }
    }

    /// Its place in [`Self::ALL`].
    pub(crate) const fn index(self) -> usize {
        self as usize
    }

    /// Whether a file or a template below `locales/` is of this language.
    pub(super) fn owns(self, path: &str) -> bool {
        path.strip_prefix(self.tag()).is_some_and(|rest| rest.starts_with('/'))
    }

    /// The best for the text of an `Accept-Language` header (RFC 4647, lookup by the primary tag); where several are
    /// liked equally well the one that is named first, and the default where none fits.
    pub fn negotiate(accept_language: &str) -> Self {
        let wishes: Vec<(&str, f64)> = accept_language.split(',').map(wish).collect();
        let mut best: Option<(Self, f64, usize)> = None;
        for language in Self::ALL {
            let named = wishes.iter().position(|(tag, _)| tag.eq_ignore_ascii_case(language.tag()));
            let place = named.or_else(|| wishes.iter().position(|(tag, _)| *tag == "*"));
            let Some(place) = place else { continue };
            let weight = wishes[place].1;
            let better = best.is_none_or(|(_, most, first)| weight > most || (weight >= most && place < first));
            if weight > 0.0 && better {
                best = Some((language, weight, place));
            }
        }
        best.map_or_else(Self::default, |(language, ..)| language)
    }
}

/// The primary tag of a wish and its weight; what is no weight counts as none.
fn wish(text: &str) -> (&str, f64) {
    let mut parts = text.split(';').map(str::trim);
    let tag = parts.next().unwrap_or_default();
    let weight = parts.find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")));
    let weight = weight.map_or(1.0, |q| q.trim().parse().ok().filter(|q| (0.0..=1.0).contains(q)).unwrap_or(0.0));
    (tag.split('-').next().unwrap_or_default(), weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_language_is_negotiated() {
        for header in ["", "en", "en-GB, fr;q=0.5", "xx", "*", "fr;q=0.9, en;q=0.1", "garbage;;q=,", "en, ru", "ru;q=0"]
        {
            assert_eq!(Language::negotiate(header), Language::En, "{header}");
        }
        for header in
            ["ru", "RU", "ru-RU", "ru-RU,ru;q=0.9,en-US;q=0.8", "ru, en", "fr, ru;q=0.1", "en;q=0.3, ru;q=0.4"]
        {
            assert_eq!(Language::negotiate(header), Language::Ru, "{header}");
        }
        // Anything but English is Russian here; a weight that is none is no wish.
        assert_eq!(Language::negotiate("en;q=0, *"), Language::Ru);
        assert_eq!(Language::negotiate("ru;q=inf, en;q=0.1"), Language::En);
        assert_eq!(Language::negotiate("ru;q=nan"), Language::En);
    }

    #[test]
    fn tags_and_places_fit_together() {
        for (index, language) in Language::ALL.into_iter().enumerate() {
            assert_eq!(language.index(), index);
            assert_eq!(Language::of_tag(language.tag()), Some(language));
        }
        assert!(Language::Ru.owns("ru/common.toml"));
        assert!(!Language::Ru.owns("en/common.toml"));
    }
}
