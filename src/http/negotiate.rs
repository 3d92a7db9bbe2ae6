//! What the client accepts: media type, language, and whether it has the answer already.

use std::borrow::Cow;

use axum::http::header::{ACCEPT, ACCEPT_LANGUAGE, AsHeaderName, IF_NONE_MATCH};
use axum::http::{HeaderMap, HeaderName};

use crate::text::Language;

/// The forms in which an answer may leave, in the order in which the service prefers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Media {
    /// The whole answer.
    Json,
    /// One of its tables.
    Csv,
    /// One of its figures.
    Svg,
    /// Its program for the machine.
    Gcode,
    /// What changed in the program that its job brought along.
    Diff,
    /// Its inputs and all of its tables as a workbook.
    Xlsx,
    /// All of it as a report on paper.
    Pdf,
}

impl Media {
    /// Type and subtype, as in `Accept`.
    pub const fn essence(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Csv => "text/csv",
            Self::Svg => "image/svg+xml",
            Self::Gcode => "text/x-gcode",
            Self::Diff => "text/x-diff",
            Self::Xlsx => "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
            Self::Pdf => "application/pdf",
        }
    }

    /// As in `Content-Type`, where an answer has nothing of its own to say.
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::Csv => "text/csv; charset=utf-8; header=present",
            Self::Gcode => "text/x-gcode; charset=utf-8",
            Self::Diff => "text/x-diff; charset=utf-8",
            Self::Json | Self::Svg | Self::Xlsx | Self::Pdf => self.essence(),
        }
    }

    /// Whether making it takes so much that only some are made at a time.
    pub(super) const fn is_heavy(self) -> bool {
        matches!(self, Self::Xlsx | Self::Pdf)
    }

    /// In entity tags and on the command line.
    pub const fn short(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Svg => "svg",
            Self::Gcode => "gcode",
            Self::Diff => "diff",
            Self::Xlsx => "xlsx",
            Self::Pdf => "pdf",
        }
    }
}

/// The offered form that the client likes best (RFC 9110, 12.5.1); the first offered one where it likes several
/// equally well or says nothing, `None` where it accepts none of them.
pub(super) fn media(headers: &HeaderMap, offered: &[Media]) -> Option<Media> {
    let accept = joined(headers, ACCEPT);
    if matches!(accept.as_ref(), "" | "*/*" | "application/json") {
        return offered.first().copied();
    }
    let liked = liked(headers, offered.iter().map(|media| media.essence()))?;
    offered.iter().copied().find(|media| media.essence() == liked)
}

/// The same for types that are no form of an answer.
pub(super) fn liked(headers: &HeaderMap, offered: impl Iterator<Item = &'static str>) -> Option<&'static str> {
    let accept = joined(headers, ACCEPT);
    let accept = if accept.is_empty() { "*/*".into() } else { accept };
    let ranges: Vec<Range<'_>> = accept.split(',').filter_map(Range::parse).collect();
    let mut best: Option<(&'static str, u16)> = None;
    for candidate in offered {
        let (kind, subtype) = candidate.split_once('/').unwrap_or_default();
        let quality = ranges
            .iter()
            .filter_map(|range| range.specificity(kind, subtype).map(|specificity| (specificity, range.quality)))
            .max_by_key(|&(specificity, _)| specificity)
            .map_or(0, |(_, quality)| quality);
        if quality > best.map_or(0, |(_, quality)| quality) {
            best = Some((candidate, quality));
        }
    }
    best.map(|(candidate, _)| candidate)
}

/// The language to answer in.
pub(super) fn language(headers: &HeaderMap) -> Language {
    let accepted = joined(headers, ACCEPT_LANGUAGE);
    if accepted.is_empty() { Language::default() } else { Language::negotiate(&accepted) }
}

/// Whether the client has the representation of that entity tag already (weak comparison, RFC 9110, 13.1.2).
pub(super) fn has_already(headers: &HeaderMap, etag: &str) -> bool {
    if !headers.contains_key(IF_NONE_MATCH) {
        return false;
    }
    let tags = joined(headers, IF_NONE_MATCH);
    tags.split(',').map(str::trim).any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
}

/// All lines of a header as one list; bytes that are no text make a line empty.
fn joined(headers: &HeaderMap, name: impl AsHeaderName + Into<HeaderName>) -> Cow<'_, str> {
    let mut lines = headers.get_all(name).iter().map(|line| line.to_str().unwrap_or_default().trim());
    let first = lines.next().unwrap_or_default();
    lines.fold(Cow::Borrowed(first), |all, line| Cow::Owned(format!("{all},{line}")))
}

/// One media range with its weight in thousandths.
struct Range<'a> {
    kind: &'a str,
    subtype: &'a str,
    quality: u16,
}

impl<'a> Range<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let mut parts = text.split(';').map(str::trim);
        let (kind, subtype) = parts.next()?.split_once('/')?;
        let weight = parts.find_map(|parameter| {
            let (name, value) = parameter.split_once('=')?;
            name.trim().eq_ignore_ascii_case("q").then(|| value.trim())
        });
        Some(Self { kind, subtype, quality: weight.map_or(Some(1000), thousandths)? })
    }

    fn specificity(&self, kind: &str, subtype: &str) -> Option<u8> {
        match (self.kind, self.subtype) {
            ("*", "*") => Some(1),
            (own, "*") if own.eq_ignore_ascii_case(kind) => Some(2),
            (own, sub) if own.eq_ignore_ascii_case(kind) && sub.eq_ignore_ascii_case(subtype) => Some(3),
            _ => None,
        }
    }
}

/// `0.35` as 350; `None` for what is no weight.
fn thousandths(text: &str) -> Option<u16> {
    let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
    if decimals.len() > 3 || !decimals.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    let value = match whole {
        "0" => format!("{decimals:0<3}").parse().ok()?,
        "1" if decimals.bytes().all(|digit| digit == b'0') => 1000,
        _ => return None,
    };
    Some(value)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const ALL: [Media; 4] = [Media::Json, Media::Csv, Media::Svg, Media::Gcode];

    fn with(name: &HeaderName, lines: &[&str]) -> HeaderMap {
        lines.iter().map(|line| (name.clone(), line.parse().unwrap())).collect()
    }

    #[test]
    fn the_best_liked_form_wins() {
        for (accept, expected) in [
            (&[][..], Some(Media::Json)),
            (&["*/*"], Some(Media::Json)),
            (&["text/csv"], Some(Media::Csv)),
            (&["TEXT/CSV"], Some(Media::Csv)),
            (&["text/csv;q=0.5, image/svg+xml"], Some(Media::Svg)),
            (&["text/csv;q=0.5", "image/svg+xml;q=0.4"], Some(Media::Csv)),
            (&["text/*"], Some(Media::Csv)),
            (&["text/*, text/csv;q=0"], Some(Media::Gcode)),
            (&["text/html,application/xhtml+xml,*/*;q=0.8"], Some(Media::Json)),
            (&["*/*;q=0.1, application/json;q=0"], Some(Media::Csv)),
            (&["text/html"], None),
            (&["application/json;q=0"], None),
            (&["text/csv;q=2"], None),
            (&["nonsense"], None),
        ] {
            assert_eq!(media(&with(&ACCEPT, accept), &ALL), expected, "{accept:?}");
        }
        assert_eq!(media(&with(&ACCEPT, &["text/x-gcode"]), &ALL[..3]), None);
    }

    #[test]
    fn entity_tags_are_compared_weakly() {
        for (sent, expected) in [
            (&[][..], false),
            (&["\"a\""], true),
            (&["W/\"a\""], true),
            (&["\"b\", \"a\""], true),
            (&["\"b\"", "\"a\""], true),
            (&["*"], true),
            (&["\"b\""], false),
            (&["a"], false),
        ] {
            assert_eq!(has_already(&with(&IF_NONE_MATCH, sent), "\"a\""), expected, "{sent:?}");
        }
    }

    #[test]
    fn weights_have_at_most_three_decimals() {
        for (text, expected) in
            [("1", Some(1000)), ("0.5", Some(500)), ("0.001", Some(1)), ("1.1", None), ("-1", None), ("0.1234", None)]
        {
            assert_eq!(thousandths(text), expected, "{text}");
        }
    }
}
