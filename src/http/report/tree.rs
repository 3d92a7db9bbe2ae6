//! A part of an answer as a tree whose lists are cut short while they are read: an answer may hold millions of numbers,
//! its paper shows some.

use std::fmt;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Items of a list that are kept.
pub(super) const MOST_ITEMS: usize = 200;

/// A JSON value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Tree {
    Nothing,
    Truth(bool),
    Number(f64),
    Word(String),
    /// The first items, and how many there are.
    List(Vec<Self>, usize),
    /// In the order of the text.
    Object(Vec<(String, Self)>),
}

impl Tree {
    /// The word that a field of an object is.
    pub(super) fn word(&self, name: &str) -> Option<&str> {
        let Self::Object(fields) = self else { return None };
        fields.iter().find_map(|(own, value)| match value {
            Self::Word(word) if own == name => Some(word.as_str()),
            _ => None,
        })
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Tree;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }
    fn visit_unit<E>(self) -> Result<Tree, E> {
        Ok(Tree::Nothing)
    }
    fn visit_bool<E>(self, truth: bool) -> Result<Tree, E> {
        Ok(Tree::Truth(truth))
    }
    fn visit_i64<E>(self, number: i64) -> Result<Tree, E> {
        Ok(Tree::Number(number as f64))
    }
    fn visit_u64<E>(self, number: u64) -> Result<Tree, E> {
        Ok(Tree::Number(number as f64))
    }
    fn visit_f64<E>(self, number: f64) -> Result<Tree, E> {
        Ok(Tree::Number(number))
    }
    fn visit_str<E>(self, word: &str) -> Result<Tree, E> {
        Ok(Tree::Word(word.to_owned()))
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Tree, A::Error> {
        let mut items = Vec::new();
        while items.len() < MOST_ITEMS {
            let Some(item) = list.next_element()? else {
                let count = items.len();
                return Ok(Tree::List(items, count));
            };
            items.push(item);
        }
        let mut count = items.len();
        while list.next_element::<IgnoredAny>()?.is_some() {
            count += 1;
        }
        Ok(Tree::List(items, count))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Tree, A::Error> {
        let mut fields = Vec::new();
        while let Some(field) = object.next_entry()? {
            fields.push(field);
        }
        Ok(Tree::Object(fields))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_long_list_is_cut_and_counted() {
        let text = format!("{{\"a\":[{}],\"b\":[1,null,true,\"x\"]}}", vec!["{\"c\":1}"; 1000].join(","));
        let Tree::Object(fields) = serde_json::from_str(&text).unwrap() else { unreachable!() };
        let Tree::List(items, 1000) = &fields[0].1 else { unreachable!("{:?}", fields[0]) };
        assert_eq!(items.len(), MOST_ITEMS);
        let kept = vec![Tree::Number(1.0), Tree::Nothing, Tree::Truth(true), Tree::Word("x".to_owned())];
        assert_eq!(fields[1], ("b".to_owned(), Tree::List(kept, 4)));
    }
}
