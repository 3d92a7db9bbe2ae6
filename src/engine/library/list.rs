//! Lists of records: own ones by name, then the engine's in the order of its data.

use std::sync::{Arc, LazyLock};

use precut_library::record::Record;
use precut_library::{Asked, Kind, Lookup, Resource, built_in, search};

use super::{Index, RecordError, StoredRecord};
use crate::engine::{Engine, Shelf};

/// What a list of records asks for.
#[derive(Debug, Clone, Default)]
pub struct RecordQuery {
    /// Only those that this text fits, best first.
    pub text: Option<String>,
    /// Only machines or tools of this kind, materials of this group, or parts for this field.
    pub class: Option<String>,
    /// Only own ones.
    pub own: bool,
    /// Only those behind the record of this name.
    pub after: Option<String>,
    /// At most so many.
    pub limit: usize,
}

/// A page of the list.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordPage {
    /// The newest revision of each.
    pub items: Vec<StoredRecord>,
    /// Whether there are more behind the last one; never where a text ranks them.
    pub more: bool,
}

/// A record that a list may have.
enum Place<'a> {
    Own(&'a str),
    BuiltIn(&'static Arc<Record>),
}

impl Place<'_> {
    fn name(&self) -> &str {
        match self {
            Self::Own(name) => name,
            Self::BuiltIn(record) => &record.name,
        }
    }
}

fn fits(wanted: Option<&str>, class: Option<&str>) -> bool {
    wanted.is_none_or(|wanted| class == Some(wanted))
}

/// The engine's own records of a kind as they are searched.
fn built_in_index(kind: Kind) -> &'static search::Index {
    static INDICES: LazyLock<[search::Index; Kind::ALL.len()]> = LazyLock::new(|| {
        Kind::ALL.map(|kind| {
            let mut index = search::Index::default();
            for record in built_in::records(kind) {
                index.add(&record.name, record.text("title").unwrap_or_default(), record.names().skip(1));
            }
            index
        })
    });
    &INDICES[kind.place()]
}

/// Every record that the query lets through, in the order of the list.
fn places<'a>(kind: Kind, own: &'a Index, query: &RecordQuery) -> Vec<Place<'a>> {
    let class = query.class.as_deref();
    let of_own = |name: &'a str| {
        let titles = own.titles();
        let found = titles.binary_search_by(|title| title.name.as_str().cmp(name)).ok();
        found.filter(|&index| fits(class, Some(&titles[index].class))).map(|_| Place::Own(name))
    };
    let of_built_in =
        |record: &'static Arc<Record>| fits(class, record.text(kind.class())).then_some(Place::BuiltIn(record));
    if let Some(text) = &query.text {
        let own = own.find(text).into_iter().filter_map(of_own);
        let all = built_in::records(kind);
        let built_in = built_in_index(kind).find(text, all.len()).into_iter();
        let built_in = built_in.filter_map(|name| built_in::find(kind, name)).filter_map(of_built_in);
        own.chain(built_in.filter(|_| !query.own)).collect()
    } else {
        let own = own.titles().iter().filter_map(|title| of_own(&title.name));
        let built_in = built_in::records(kind).iter().filter_map(of_built_in).filter(|_| !query.own);
        own.chain(built_in).collect()
    }
}

impl Engine {
    /// The newest revisions of the records of a kind that a query lets through.
    pub async fn records(&self, shelf: &Shelf, kind: Kind, query: RecordQuery) -> Result<RecordPage, RecordError> {
        let finder = self.inner.finder(shelf).await?;
        let index = finder.index(kind).await?;
        let mut places = places(kind, &index, &query);
        if let Some(after) = &query.after {
            let behind = places.iter().position(|place| match place {
                Place::Own(name) => *name > after.as_str() && built_in::find(kind, after).is_none(),
                Place::BuiltIn(_) => false,
            });
            let at = places.iter().position(|place| place.name() == after).map(|at| at + 1);
            let first_built_in = || places.iter().position(|place| matches!(place, Place::BuiltIn(_)));
            let from = at.or(behind).or_else(first_built_in).unwrap_or(places.len());
            places.drain(..from);
        }
        let more = query.text.is_none() && places.len() > query.limit;
        places.truncate(query.limit);
        let mut items = Vec::with_capacity(places.len());
        for place in places {
            let name = match place {
                Place::BuiltIn(record) => {
                    items.push(StoredRecord::built_in(record));
                    continue;
                }
                Place::Own(name) => name,
            };
            let asked = Asked { kind, pointer: String::new(), name: name.to_owned(), revision: None };
            let looked = finder.record(&asked).await?;
            // It may have been deleted since the index was read.
            if let Lookup::Found(Resource { record, revision }) = looked.lookup {
                items.push(StoredRecord { record, revision, sha256: looked.sha256, created_ms: None });
            }
        }
        Ok(RecordPage { items, more })
    }
}
