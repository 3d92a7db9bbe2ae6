//! Names in a job: what their records say is written into it, with the origin of every number.
//!
//! In three steps. [`asked()`] says which records a job names. Whoever keeps records looks them up. [`resolve()`] writes them
//! into the job before its schema is checked and its defaults are filled in: an absent field is filled, an explicit
//! value stays, an explicit 0 too (0 is rigid). What names alone need (`machine`, `tool`, `material`, `rest`,
//! `normal_force`, `kienzle_row`, `source`, `cut_kind`) is gone from it then.

mod asked;
mod force;
mod kinds;
mod milling;
mod origin;
mod overrides;
mod schedule;
mod turning;
mod view;
mod writer;

pub use asked::{Asked, asked};
pub use origin::{From, Origin, Part};

use std::sync::Arc;

use precut_calc::calculator::{Finding, Message};
use serde_json::Value;

use crate::record::{Kind, Record};
use view::Views;
use writer::Writer;

/// Codes of the faults that [`resolve()`] may find.
pub const FAULT_CODES: &[&str] = &[
    "above_machine_limit",
    "ambiguous_material",
    "bad_holder_clamping",
    "bad_holder_clearance",
    "bad_holder_code",
    "bad_holder_length",
    "bad_holder_shape",
    "bad_insert_clearance",
    "bad_insert_code",
    "bad_insert_corner",
    "bad_insert_shape",
    "bad_insert_thickness",
    "bad_insert_tolerance",
    "bad_insert_type",
    "bad_record_name",
    "characteristic_not_rising",
    "compliance_or_single_stiffness",
    "deleted_record",
    "ends_reversed",
    "holder_for_facing",
    "insert_does_not_fit_holder",
    "limits_do_not_meet",
    "material_without_force_law",
    "name_or_codes_missing",
    "no_minor_edge_clearance",
    "no_recommended_feed",
    "no_recommended_speed",
    "passive_force_missing",
    "several_preferred_rows",
    "stiffness_meaning_missing",
    "unknown_holder_style",
    "unknown_kienzle_row",
    "unknown_machine",
    "unknown_material",
    "unknown_rest",
    "unknown_revision",
    "unknown_tool",
    "value_outside_its_ends",
    "wrong_kind_of_machine",
    "wrong_kind_of_tool",
];

/// Codes of the warnings of [`resolve()`].
pub const WARNING_CODES: &[&str] = &[
    "bar_overhang_beyond_limit",
    "contradicts_code",
    "edge_life_extrapolated",
    "force_sources_differ",
    "judged_normal_force",
    "machine_without_number",
    "overrides_record",
    "spindle_characteristic_simplified",
];

/// Codes of the explanations of [`resolve()`].
pub const EXPLANATION_CODES: &[&str] =
    &["library_compliance", "library_force_sources", "library_rake_corrected", "library_rake_not_corrected"];

/// Which state of a record a job got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Revision {
    /// Revision of an own record.
    Own(u32),
    /// A built-in one, by the version of the data.
    BuiltIn(u32),
}

/// A record as it was when the job was accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct Resource {
    /// The record.
    pub record: Arc<Record>,
    /// Its state.
    pub revision: Revision,
}

/// What came of looking a name up.
#[derive(Debug, Clone, PartialEq)]
pub enum Lookup {
    /// The record.
    Found(Resource),
    /// There is none.
    Unknown {
        /// Names that were probably meant, best first.
        nearest: Vec<String>,
    },
    /// It has no such revision.
    UnknownRevision {
        /// The last one.
        last: u32,
    },
    /// It was deleted.
    Deleted,
    /// Several materials are called so.
    Ambiguous {
        /// Their names.
        candidates: Vec<String>,
    },
}

impl Lookup {
    /// A built-in record, by its name or, of a material, by any of its names.
    pub fn built_in(asked: &Asked) -> Self {
        use crate::built_in;
        let found = |record: &Arc<Record>| {
            Self::Found(Resource { record: Arc::clone(record), revision: Revision::BuiltIn(built_in::DATA_VERSION) })
        };
        if let Some(record) = built_in::find(asked.kind, &asked.name) {
            return match asked.revision {
                Some(revision) if revision != built_in::DATA_VERSION => {
                    Self::UnknownRevision { last: built_in::DATA_VERSION }
                }
                _ => found(record),
            };
        }
        if asked.kind == Kind::Material {
            match built_in::materials_called(&asked.name) {
                [] => {}
                [one] => return found(one),
                several => {
                    return Self::Ambiguous { candidates: several.iter().map(|record| record.name.clone()).collect() };
                }
            }
        }
        let known = built_in::records(asked.kind).iter().flat_map(|record| record.names());
        Self::Unknown { nearest: crate::search::nearest(&asked.name, known) }
    }
}

/// What came of a job's names.
#[derive(Debug, Default)]
pub struct Resolution {
    /// Every number that a record had a say in, in the order of the records.
    pub origins: Vec<Origin>,
    /// Faults, at their places in the job as it came. With one the job is filled in part: that a field is missing then
    /// is no fault of its own.
    pub faults: Vec<Finding>,
    /// Warnings, at their places in the filled job.
    pub warnings: Vec<Finding>,
    /// What is to be said of the numbers, most important first.
    pub explanation: Vec<Message>,
}

/// Writes what the records say into a job of `calculator`, before its defaults are filled in.
///
/// `found` is what came of looking up each of [`asked()`].
pub fn resolve(calculator: &str, job: &mut Value, found: &[(Asked, Lookup)]) -> Resolution {
    let mut writer = Writer::new(job);
    let Some(room) = kinds::Room::of(calculator) else { return writer.into_resolution() };
    let Some(views) = Views::take(room, &mut writer, found) else { return writer.into_resolution() };
    kinds::check(room, &views, &mut writer);
    match room {
        kinds::Room::Deflection => {
            turning::fill(room, calculator, &views, &mut writer);
            turning::check_cut(&views, &mut writer);
            force::fill(room, &views, &mut writer);
        }
        kinds::Room::Schedule => {
            turning::fill(room, calculator, &views, &mut writer);
            schedule::fill(&views, &mut writer);
            force::fill(room, &views, &mut writer);
        }
        kinds::Room::Program => {
            turning::fill(room, calculator, &views, &mut writer);
            force::turret(&views, &mut writer);
            force::fill(room, &views, &mut writer);
        }
        kinds::Room::Ring => force::ring(&views, &mut writer),
        kinds::Room::Milling | kinds::Room::Cutter => milling::fill(room, calculator, &views, &mut writer),
    }
    writer.into_resolution()
}
