//! Every fault of a process and its parts at once.

use std::collections::BTreeMap;

use crate::calculator::{Calculator, Check, Finding, Measurement, Violations, Watched};
use crate::process::part::document::{Document, MOST_PARTS, Options, Part};
use crate::process::part::edges::completed;

/// Rows of a part at most; of more, means per station are sent.
pub(in crate::process) const MOST_ROWS: usize = 400;
/// Types of parts at most.
const MOST_TYPES: usize = 8;

/// Faults of a process beside those of its calculator's own job, runs and places.
pub const CODES: &[&str] = &[
    "part_types_missing",
    "process_too_large",
    "part_type_not_declared",
    "number_taken",
    "unknown_quantity",
    "value_missing",
    "condition_missing",
    "condition_contradicts",
    "unit_suspected",
    "out_of_range",
];

/// All faults, each with its pointer into `{..., "parts": [...]}`. Parts may stand in any order.
pub fn faults<M: Watched>(
    document: &Document<<M as Calculator>::Input, M::Allowances>,
    parts: &[Part<M::Run, M::Row>],
) -> Vec<Finding> {
    let mut found = Violations::default();
    of_document::<M>(document, &mut found);
    found.require(parts.len() <= MOST_PARTS, || too_large("/parts", parts.len(), MOST_PARTS));
    for (index, part) in parts.iter().enumerate() {
        let mut own = Violations::default();
        of_part::<M>(document, part, &mut own);
        own.into_vec().into_iter().for_each(|fault| found.add(fault.under(&format!("/parts/{index}"))));
    }
    between_parts::<M>(document, parts, &mut found);
    found.into_vec()
}

fn too_large(pointer: &str, count: usize, most: usize) -> Finding {
    Finding::new("process_too_large", pointer).measured(count as f64, most as f64, "1")
}

fn of_document<M: Watched>(document: &Document<<M as Calculator>::Input, M::Allowances>, found: &mut Violations) {
    let types = document.part_types.len();
    found.require(types > 0, || Finding::new("part_types_missing", "/part_types"));
    found.require(types <= MOST_TYPES, || too_large("/part_types", types, MOST_TYPES));
    for (name, of_type) in &document.part_types {
        let mut own = Violations::default();
        of_type.job.check(&mut own);
        let pointer = format!("/part_types/{}/job", name.replace('~', "~0").replace('/', "~1"));
        own.into_vec().into_iter().for_each(|fault| found.add(fault.under(&pointer)));
    }
    let all = M::QUANTITIES.iter().map(|quantity| quantity.name);
    let known: Vec<&'static str> = all.filter(|name| M::per_diameter_um(name) > 0.0).collect();
    found.require(known.contains(&document.quantity.as_str()), || {
        Finding::new("unknown_quantity", "/quantity").with("quantity", document.quantity.clone()).with("known", known)
    });
    let noise = document.noise_um;
    found.require(noise.is_none_or(|noise| noise > 0.0 && noise <= 1000.0), || {
        Finding::new("out_of_range", "/noise_um")
            .value(noise.unwrap_or_default(), "um")
            .with("above", 0.0)
            .with("maximum", 1000.0)
    });
    of_options(&document.options, found);
}

fn of_options(options: &Options, found: &mut Violations) {
    let mut within = |name: &str, value: f64, least: f64, most: f64| {
        found.require((least..=most).contains(&value), || {
            Finding::new("out_of_range", format!("/options/{name}")).value(value, "1").within(least, most)
        });
    };
    within("false_alarm_every_parts", f64::from(options.false_alarm_every_parts), 50.0, 1e5);
    within("learning_parts", f64::from(options.learning_parts), 5.0, 160.0);
    within("settle_parts", f64::from(options.settle_parts), 1.0, 30.0);
    within("change_every_parts", f64::from(options.change_every_parts), 10.0, 1e5);
    within("bad_part_share", options.bad_part_share, 0.0, 0.1);
    within("changed_after_parts", f64::from(options.changed_after_parts), 1.0, 2.0);
    within("memory_parts", options.memory(), 200.0, 1e6);
    within("offset_limit_um", options.offset_limit_um, 0.0, 1e5);
}

fn of_part<M: Watched>(
    document: &Document<<M as Calculator>::Input, M::Allowances>,
    part: &Part<M::Run, M::Row>,
    found: &mut Violations,
) {
    let of_type = document.part_types.get(&part.part_type);
    found.require(of_type.is_some(), || {
        let known: Vec<String> = document.part_types.keys().cloned().collect();
        Finding::new("part_type_not_declared", "/part_type")
            .with("part_type", part.part_type.clone())
            .with("known", known)
    });
    for fault in M::faults_of_run(&part.conditions) {
        found.add(fault.under("/conditions"));
    }
    let rows = part.measurements.len();
    found.require(rows <= MOST_ROWS, || too_large("/measurements", rows, MOST_ROWS));
    for (index, row) in part.measurements.iter().enumerate() {
        let pointer = format!("/measurements/{index}");
        let counts = !row.excluded() && M::per_diameter_um(&document.quantity) > 0.0;
        found.require(!counts || row.value(&document.quantity).is_some_and(f64::is_finite), || {
            Finding::new("value_missing", pointer.clone()).with("quantity", document.quantity.clone())
        });
        let places = of_type.map_or_else(Vec::new, |of| M::faults_of_point(&of.job, &row.point()));
        for fault in places {
            found.add(fault.under(&pointer));
        }
    }
    for (index, check) in part.gauge_checks.iter().enumerate() {
        let (pointer, u) = (format!("/gauge_checks/{index}"), check.uncertainty_um);
        found.require(u > 0.0 && u <= 1000.0, || {
            Finding::new("out_of_range", format!("{pointer}/uncertainty_um"))
                .value(u, "um")
                .with("above", 0.0)
                .with("maximum", 1000.0)
        });
        found.require(check.measured_um.abs() <= 1e6, || {
            Finding::new("out_of_range", format!("{pointer}/measured_um"))
                .value(check.measured_um, "um")
                .within(-1e6, 1e6)
        });
    }
}

/// What parts say beside each other: numbers, conditions that all state or none, edges that only go on. Of an edge of which every
/// part came its path is known.
fn between_parts<M: Watched>(
    document: &Document<<M as Calculator>::Input, M::Allowances>,
    parts: &[Part<M::Run, M::Row>],
    found: &mut Violations,
) {
    let mut by_number: BTreeMap<u32, usize> = BTreeMap::new();
    for (index, part) in parts.iter().enumerate() {
        let first = *by_number.entry(part.number).or_insert(index);
        found.require(first == index, || {
            Finding::new("number_taken", format!("/parts/{index}/number"))
                .value(f64::from(part.number), "1")
                .with("part", first)
        });
    }
    let mut edge = None;
    let in_order = by_number.into_values().map(|index| (index, completed::<M>(document, &parts[index], &mut edge)));
    let in_order: Vec<_> = in_order.collect();
    let mut stated: Vec<&'static str> = Vec::new();
    for (_, part) in &in_order {
        let own = M::conditions(&part.conditions);
        stated.extend(own.into_iter().filter(|(_, value)| value.is_some()).map(|(name, _)| name));
    }
    let mut before: Option<(u32, f64)> = None;
    for (index, part) in &in_order {
        for (name, value) in M::conditions(&part.conditions) {
            let cause = M::CAUSES.iter().find(|cause| cause.conditions.contains(&name));
            found.require(value.is_some() || !stated.contains(&name), || {
                Finding::new("condition_missing", format!("/parts/{index}/conditions/{name}"))
                    .with("kind", cause.map_or("", |cause| cause.kind))
                    .with("condition", name)
            });
        }
        let Some(edge) = part.edge else { continue };
        let path_m = M::path_m(&part.conditions).unwrap_or(0.0);
        if let Some((edge_before, path_before)) = before {
            let contradicts = |field: &str| Finding::new("condition_contradicts", format!("/parts/{index}/{field}"));
            found.require(edge >= edge_before, || {
                contradicts("edge").measured(f64::from(edge), f64::from(edge_before), "1")
            });
            found.require(edge != edge_before || path_m >= path_before, || {
                contradicts("conditions/tool_path_at_start_m").measured(path_m, path_before, "m")
            });
        }
        before = Some((edge, path_m));
    }
}
