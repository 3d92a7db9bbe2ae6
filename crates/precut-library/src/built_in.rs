//! The records that the engine ships.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, LazyLock};

use serde::Deserialize;
use serde_json::{Map, Value};

use crate::record::{Kind, Record, settle};
use crate::search::fold;

/// Revision of all built-in records; grows with every changed number.
pub const DATA_VERSION: u32 = 1;

const FILES: [(Kind, &str); 3] = [
    (Kind::Machine, include_str!("../data/machines.json")),
    (Kind::Tool, include_str!("../data/tools.json")),
    (Kind::Material, include_str!("../data/materials.json")),
];

/// Where numbers come from.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Title of the work.
    pub title: String,
    /// Who published it.
    pub publisher: Option<String>,
    /// When.
    pub year: Option<u32>,
    /// Page or table.
    pub place: Option<String>,
    /// Where it can be read; absent where nobody looked it up.
    pub address: Option<String>,
}

impl Source {
    /// Title, publisher, year and place.
    pub fn text(&self) -> String {
        let year = self.year.map(|year| year.to_string());
        let parts = [Some(&self.title), self.publisher.as_ref(), year.as_ref(), self.place.as_ref()];
        let said: Vec<&str> = parts.into_iter().flatten().map(String::as_str).filter(|part| *part != "-").collect();
        said.join(", ")
    }
}

/// How the specific force depends on the rake in one source: `library/2`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RakeCorrection {
    /// A degree more of rake makes the force so much less, percent.
    pub slope_percent_per_deg: f64,
    /// Rake of the table, degrees.
    pub base_rake_deg: f64,
    /// Group of ISO 513.
    pub for_group: String,
    /// Key of its source.
    pub source: String,
}

/// The normal force as a judged share of the cutting force: `library/6`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct JudgedNormalForce {
    /// Group of ISO 513.
    pub iso513_group: String,
    /// k_n over k_c at a chip thickness of 0.2 mm.
    pub normal_to_cutting_force_at_0_2_mm: f64,
    /// Least likely share.
    pub low: f64,
    /// Largest likely share.
    pub high: f64,
    /// m_n.
    pub normal_exponent: f64,
}

/// All that is shipped.
struct Library {
    records: BTreeMap<Kind, Vec<Arc<Record>>>,
    by_name: HashMap<(Kind, String), Arc<Record>>,
    /// Materials by every folded name.
    called: HashMap<String, Vec<Arc<Record>>>,
    sources: HashMap<String, Source>,
    rake: Vec<RakeCorrection>,
    normal: Vec<JudgedNormalForce>,
}

static LIBRARY: LazyLock<Library> = LazyLock::new(read);

fn read() -> Library {
    let mut library = Library {
        records: BTreeMap::new(),
        by_name: HashMap::new(),
        called: HashMap::new(),
        sources: HashMap::new(),
        rake: Vec::new(),
        normal: Vec::new(),
    };
    for (kind, text) in FILES {
        let mut file: Map<String, Value> = serde_json::from_str(text).expect("the shipped records are JSON");
        let mut take = |name: &str| file.remove(name).unwrap_or_default();
        let sources: HashMap<String, Source> =
            serde_json::from_value(take("sources")).expect("the shipped sources are complete");
        library.sources.extend(sources);
        if kind == Kind::Material {
            library.rake =
                serde_json::from_value(take("rake_corrections")).expect("the shipped corrections are complete");
            library.normal =
                serde_json::from_value(take("judged_normal_force")).expect("the shipped judgements are complete");
        }
        let Value::Array(items) = take(kind.plural()) else { continue };
        library.add(kind, items);
    }
    library
}

impl Library {
    fn add(&mut self, kind: Kind, items: Vec<Value>) {
        for mut value in items {
            let Some(Value::String(name)) = value.as_object_mut().and_then(|fields| fields.remove("id")) else {
                continue;
            };
            settle(kind, &mut value);
            let record = Arc::new(Record { kind, name: name.clone(), value });
            if kind == Kind::Material {
                for folded in folded_names(&record) {
                    self.called.entry(folded).or_default().push(Arc::clone(&record));
                }
            }
            self.records.entry(kind).or_default().push(Arc::clone(&record));
            self.by_name.insert((kind, name), record);
        }
    }
}

/// The folded names of a material, each once.
pub fn folded_names(record: &Record) -> Vec<String> {
    let mut names: Vec<String> = record.names().map(fold).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// All records of a kind, in the order of the data.
pub fn records(kind: Kind) -> &'static [Arc<Record>] {
    LIBRARY.records.get(&kind).map_or(&[], Vec::as_slice)
}

/// The record of that name.
pub fn find(kind: Kind, name: &str) -> Option<&'static Arc<Record>> {
    LIBRARY.by_name.get(&(kind, name.to_owned()))
}

/// The materials that a name of any standard fits, however it is spelled.
pub fn materials_called(name: &str) -> &'static [Arc<Record>] {
    LIBRARY.called.get(&fold(name)).map_or(&[], Vec::as_slice)
}

/// What the key of a source stands for.
pub fn source(key: &str) -> Option<&'static Source> {
    LIBRARY.sources.get(key)
}

/// All sources by key.
pub fn sources() -> impl Iterator<Item = (&'static str, &'static Source)> {
    LIBRARY.sources.iter().map(|(key, source)| (key.as_str(), source))
}

/// Corrections for the rake.
pub fn rake_corrections() -> &'static [RakeCorrection] {
    &LIBRARY.rake
}

/// The judged share of the normal force in a group.
pub fn judged_normal_force(group: &str) -> Option<&'static JudgedNormalForce> {
    LIBRARY.normal.iter().find(|row| row.iso513_group == group)
}
