//! The few SVG elements in use, written as text.

use std::fmt::{self, Display, Write};

/// A document under way.
#[derive(Debug, Default)]
pub(super) struct Page(String);

impl Page {
    /// Appends markup whose texts are already [`Escaped`].
    pub(super) fn put(&mut self, markup: fmt::Arguments<'_>) {
        self.0.write_fmt(markup).expect("a string takes every text");
    }

    pub(super) fn into_string(self) -> String {
        self.0
    }
}

/// `put!(page, "<g class=\"{}\">", class)`.
macro_rules! put {
    ($page:expr, $($markup:tt)*) => { $page.put(format_args!($($markup)*)) };
}
pub(super) use put;

/// A place on the page, to a hundredth of a pixel; never anything but a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Px(pub(super) f64);

impl Display for Px {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let px = if self.0.is_finite() { self.0.clamp(-1e5, 1e5) } else { 0.0 };
        let text = format!("{px:.2}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}

/// Text that is only text, whatever stands in it. Characters that XML cannot hold are dropped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Escaped<'a>(pub(super) &'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\u{0}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' => f.write_char(' '),
            c => f.write_char(c),
        })
    }
}

/// About how wide a text is in a sans-serif face, for room that cannot be measured here.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let ems: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | 't' | 'f' | 'r' | 'I' | ' ' | '.' | ',' | ':' | ';' | '(' | ')' | '[' | ']' | '|'
            | '/' => 0.36,
            '%' | 'm' | 'w' | 'M' | 'W' | 'ж' | 'м' | 'ш' | 'щ' | 'ю' | 'ф' | 'ы' | 'Ж' | 'М' | 'Ш' | 'Щ' | 'Ю'
            | 'Ф' | 'Ы' => 0.9,
            c if c.is_uppercase() => 0.72,
            c if u32::from(c) >= 0x2e80 => 1.0,
            _ => 0.6,
        })
        .sum();
    ems * size
}

/// The text in lines of at most `room_px`, broken between words.
pub(super) fn lines(text: &str, size: f64, room_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(line, size) + width(word, size) + 0.36 * size <= room_px => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_short_and_numbers() {
        for (px, text) in
            [(1.0, "1"), (-0.001, "0"), (12.345, "12.35"), (100.0, "100"), (f64::NAN, "0"), (1e300, "100000")]
        {
            assert_eq!(Px(px).to_string(), text);
        }
    }

    #[test]
    fn text_stays_text() {
        assert_eq!(Escaped("<a & \"b\">\u{7}\n").to_string(), "&lt;a &amp; &quot;b&quot;&gt;  ");
    }

    #[test]
    fn long_texts_break() {
        assert_eq!(lines("one two three", 10.0, 50.0), ["one two", "three"]);
        assert_eq!(lines("", 10.0, 50.0), Vec::<String>::new());
    }
}
