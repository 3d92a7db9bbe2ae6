//! Numbers at given pointers out of the bytes of an answer, without building the answer.

use std::cell::RefCell;
use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

/// Where the wanted numbers stand.
#[derive(Debug, Clone, Default)]
pub(crate) struct Wanted {
    /// Which of them stands here.
    here: Vec<usize>,
    inner: Vec<(String, Wanted)>,
    count: usize,
}

/// What is taken from an answer.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Picked {
    /// The wanted numbers, `None` where there is none.
    pub(crate) numbers: Vec<Option<f64>>,
    /// Its warnings.
    pub(crate) warnings: Vec<Warning>,
    /// The equations that it cites.
    pub(crate) basis: Vec<Cited>,
}

/// A warning of an answer.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct Warning {
    pub(crate) code: String,
    pub(crate) pointer: String,
    /// What its sentence says, as it stands in the answer.
    #[serde(flatten)]
    pub(crate) said: Map<String, Value>,
}

/// An equation that an answer cites.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Deserialize, serde::Serialize)]
pub(crate) struct Cited {
    pub(crate) equation: String,
    pub(crate) source: String,
}

impl Wanted {
    /// The numbers at these pointers (as tokens), in this order.
    pub(crate) fn new(pointers: &[Vec<String>]) -> Self {
        let mut wanted = Self { count: pointers.len(), ..Self::default() };
        for (number, tokens) in pointers.iter().enumerate() {
            let mut place = &mut wanted;
            for token in tokens {
                let known = place.inner.iter().position(|(name, _)| name == token);
                let at = known.unwrap_or_else(|| {
                    place.inner.push((token.clone(), Self::default()));
                    place.inner.len() - 1
                });
                place = &mut place.inner[at].1;
            }
            place.here.push(number);
        }
        wanted
    }

    fn inside(&self, name: &str) -> Option<&Self> {
        self.inner.iter().find_map(|(known, inner)| (known == name).then_some(inner))
    }

    /// What is wanted from an answer's envelope.
    pub(crate) fn pick(&self, envelope: &[u8]) -> serde_json::Result<Picked> {
        let mut deserializer = serde_json::Deserializer::from_slice(envelope);
        deserializer.deserialize_map(Envelope(self))
    }
}

struct Envelope<'w>(&'w Wanted);

impl<'de> Visitor<'de> for Envelope<'_> {
    type Value = Picked;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an answer")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Picked, A::Error> {
        let numbers = RefCell::new(vec![None; self.0.count]);
        let mut picked = Picked::default();
        while let Some(name) = access.next_key::<String>()? {
            match name.as_str() {
                "result" => access.next_value_seed(Part { wanted: self.0, numbers: &numbers })?,
                "warnings" => picked.warnings = access.next_value()?,
                "basis" => picked.basis = access.next_value()?,
                _ => drop(access.next_value::<IgnoredAny>()?),
            }
        }
        picked.numbers = numbers.into_inner();
        Ok(picked)
    }
}

/// A part of the result in which something is wanted.
#[derive(Clone, Copy)]
struct Part<'w> {
    wanted: &'w Wanted,
    numbers: &'w RefCell<Vec<Option<f64>>>,
}

impl Part<'_> {
    fn found(self, number: f64) {
        for &index in &self.wanted.here {
            self.numbers.borrow_mut()[index] = Some(number);
        }
    }
}

impl<'de> DeserializeSeed<'de> for Part<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Part<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a part of a result")
    }
    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }
    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }
    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }
    fn visit_f64<E>(self, number: f64) -> Result<(), E> {
        self.found(number);
        Ok(())
    }
    #[allow(clippy::cast_precision_loss)] // a result is read as doubles everywhere
    fn visit_u64<E>(self, number: u64) -> Result<(), E> {
        self.found(number as f64);
        Ok(())
    }
    #[allow(clippy::cast_precision_loss)]
    fn visit_i64<E>(self, number: i64) -> Result<(), E> {
        self.found(number as f64);
        Ok(())
    }
    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<(), A::Error> {
        while let Some(name) = access.next_key::<String>()? {
            match self.wanted.inside(&name) {
                Some(wanted) => access.next_value_seed(Part { wanted, ..self })?,
                None => drop(access.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<(), A::Error> {
        let wants_items = self.wanted.inner.iter().any(|(name, _)| super::expand::index(name).is_some());
        let mut index = 0_usize;
        loop {
            let wanted = if wants_items { self.wanted.inside(&index.to_string()) } else { None };
            let more = match wanted {
                Some(wanted) => access.next_element_seed(Part { wanted, ..self })?.is_some(),
                None => access.next_element::<IgnoredAny>()?.is_some(),
            };
            if !more {
                return Ok(());
            }
            index += 1;
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::expand::tokens;
    use super::*;
    use proptest::prelude::*;
    use serde_json::{Value, json};

    fn picked(envelope: &Value, pointers: &[&str]) -> Picked {
        let pointers: Vec<_> = pointers.iter().map(|pointer| tokens(pointer).unwrap()).collect();
        Wanted::new(&pointers).pick(envelope.to_string().as_bytes()).unwrap()
    }

    #[test]
    fn numbers_warnings_and_equations_come_out() {
        let envelope = json!({
            "input": {"a": 9}, "result": {"a": 1.5, "b": [{"c": 2}, {"c": null}], "d": "x", "e": {"a": -3}},
            "warnings": [{"code": "w", "pointer": "/p", "detail": "..", "value": 1}],
            "basis": [{"equation": "toy/1", "source": "s"}],
        });
        let found = picked(&envelope, &["/e/a", "/a", "/b/0/c", "/b/1/c", "/b/2/c", "/d", "/a"]);
        assert_eq!(found.numbers, [Some(-3.0), Some(1.5), Some(2.0), None, None, None, Some(1.5)]);
        let said = json!({"detail": "..", "value": 1}).as_object().cloned().unwrap();
        assert_eq!(found.warnings, [Warning { code: "w".to_owned(), pointer: "/p".to_owned(), said }]);
        assert_eq!(found.basis, [Cited { equation: "toy/1".to_owned(), source: "s".to_owned() }]);
    }

    fn any_json() -> impl Strategy<Value = Value> {
        let leaf =
            prop_oneof![Just(Value::Null), any::<bool>().prop_map(Value::from), (-1e6..1e6).prop_map(Value::from)];
        leaf.prop_recursive(3, 24, 4, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
                prop::collection::btree_map("[ab0-2]", inner, 0..4)
                    .prop_map(|map| Value::Object(map.into_iter().collect())),
            ]
        })
    }

    proptest! {
        /// The measure is serde_json's own way along a pointer.
        #[test]
        fn it_finds_what_the_whole_value_has(
            result in any_json(), pointers in prop::collection::vec("(/[ab0-2]){1,3}", 1..6),
        ) {
            let envelope = json!({ "result": result });
            let pointers: Vec<&str> = pointers.iter().map(String::as_str).collect();
            let expected: Vec<Option<f64>> =
                pointers.iter().map(|pointer| result.pointer(pointer).and_then(Value::as_f64)).collect();
            prop_assert_eq!(picked(&envelope, &pointers).numbers, expected);
        }
    }
}
