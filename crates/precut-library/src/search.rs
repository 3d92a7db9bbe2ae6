//! How a record is found by what somebody types.

/// A name as it is compared: small letters and digits alone; Cyrillic letters of GOST in Latin ones, and `kh` as the `x`
/// that it is mostly typed as. `40Х`, `40Kh` and `40X` are one, so are `1.7225` and `17225`.
pub fn fold(text: &str) -> String {
    let mut folded = String::with_capacity(text.len());
    for letter in text.chars().flat_map(char::to_lowercase) {
        match letter {
            'h' if folded.ends_with('k') => {
                folded.pop();
                folded.push('x');
            }
            _ if letter.is_ascii_alphanumeric() => folded.push(letter),
            _ => folded.push_str(latin(letter)),
        }
    }
    folded
}

/// A small letter in Latin ones; what is no letter of a name is nothing.
fn latin(letter: char) -> &'static str {
    const CYRILLIC: [&str; 32] = [
        "a", "b", "v", "g", "d", "e", "zh", "z", "i", "y", "k", "l", "m", "n", "o", "p", "r", "s", "t", "u", "f", "x",
        "ts", "ch", "sh", "shch", "", "y", "", "e", "yu", "ya",
    ];
    match letter {
        'ё' => "e",
        'ä' | 'á' | 'à' => "a",
        'ö' | 'ó' => "o",
        'ü' | 'ú' => "u",
        'ß' => "ss",
        'а'..='я' => CYRILLIC.get(letter as usize - 'а' as usize).copied().unwrap_or_default(),
        _ => "",
    }
}

/// Records by what they are called.
#[derive(Debug, Default)]
pub struct Index {
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    name: String,
    /// Folded names, then the folded title.
    folded: Vec<String>,
}

impl Index {
    /// Adds a record by its name, title and other names.
    pub fn add<'a>(&mut self, name: &'a str, title: &str, others: impl Iterator<Item = &'a str>) {
        let mut folded: Vec<String> = std::iter::once(name).chain(others).map(fold).collect();
        folded.push(fold(title));
        self.entries.push(Entry { name: name.to_owned(), folded });
    }

    /// Names of the records that the text fits, best first: called so, beginning so, having it somewhere. Words apart by
    /// blanks must all fit. An empty text fits all.
    pub fn find(&self, text: &str, most: usize) -> Vec<&str> {
        let whole = fold(text);
        let words: Vec<String> = text.split_whitespace().map(fold).filter(|word| !word.is_empty()).collect();
        let mut found: Vec<(u8, usize)> = self
            .entries
            .iter()
            .enumerate()
            .filter_map(|(index, entry)| Some((entry.rank(&whole, &words)?, index)))
            .collect();
        found.sort_unstable();
        found.into_iter().take(most).map(|(_, index)| self.entries[index].name.as_str()).collect()
    }
}

impl Entry {
    /// 0 for a name, 1 for the beginning of one, 2 for a part, 3 for words here and there.
    fn rank(&self, whole: &str, words: &[String]) -> Option<u8> {
        let best = self.folded.iter().filter_map(|name| {
            name.find(whole).map(|at| match (at, name.len() == whole.len()) {
                (_, true) => 0,
                (0, false) => 1,
                _ => 2,
            })
        });
        best.min().or_else(|| {
            let has = |word: &String| self.folded.iter().any(|name| name.contains(word.as_str()));
            (words.len() > 1 && words.iter().all(has)).then_some(3)
        })
    }
}

/// The names most like a text, at most three, best first.
pub fn nearest<'a>(text: &str, known: impl Iterator<Item = &'a str>) -> Vec<String> {
    const ALIKE: f64 = 0.8;
    const LONGEST: usize = 256;
    if text.len() > LONGEST {
        return Vec::new();
    }
    let text = fold(text);
    let mut alike: Vec<(f64, &str)> = known
        .map(|name| (strsim::jaro_winkler(&text, &fold(name)), name))
        .filter(|(alike, _)| *alike >= ALIKE)
        .collect();
    alike.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(b.1)));
    alike.dedup_by(|a, b| a.1 == b.1);
    alike.into_iter().take(3).map(|(_, name)| name.to_owned()).collect()
}
