//! Tool and material in the force of a turning job, and the material in its shaft.

use precut_calc::calculator::{Finding, Message};
use serde_json::Value;

use super::kinds::Room;
use super::origin::{From, Part};
use super::view::{View, Views};
use super::writer::Writer;
use crate::kienzle::{self, Choice, JUDGED_FORCE_PERCENT, Row, Sources};

/// Elastic constants of the shaft, then the force.
pub(super) fn fill(room: Room, views: &Views<'_>, writer: &mut Writer<'_>) {
    // A schedule of stated compliances has no shaft, and a program that is only read no blank.
    let has_work = room == Room::Deflection || writer.at(&format!("/{}", room.work())).is_some();
    if let Some(material) = views.material_of_shaft().filter(|_| has_work) {
        elastic(room, material, writer);
    }
    let wants_force = writer.at("/force").is_some() || room == Room::Deflection;
    if !wants_force {
        return;
    }
    let material = views.material_of_force();
    if writer.at("/force/kind").is_none() && material.is_some_and(|material| !rows_of(material).is_empty()) {
        writer.put("/force/kind", "kienzle".into());
    }
    if let Some(tool) = views.tools().next() {
        geometry(tool, writer);
    }
    match writer.word("/force/kind") {
        Some("kienzle") => of_kienzle(room, views, writer),
        Some("handbook") => {
            if let Some(material) = material {
                handbook(material, writer);
            }
        }
        _ => {}
    }
}

/// The edges of the tools of a turret.
pub(super) fn turret(views: &Views<'_>, writer: &mut Writer<'_>) {
    for tool in &views.described {
        for field in ["nose_radius_mm", "cutting_edge_angle_deg", "minor_edge_angle_deg"] {
            let pointer = format!("{}/{field}", tool.pointer);
            if let Some((value, part)) = of_tool(tool, field, &pointer, writer) {
                writer.offer(&pointer, value, vec![part]);
            }
        }
    }
}

/// The law of a wide edge.
pub(super) fn ring(views: &Views<'_>, writer: &mut Writer<'_>) {
    of_kienzle(Room::Ring, views, writer);
}

fn elastic(room: Room, material: &View<'_>, writer: &mut Writer<'_>) {
    let fields = ["youngs_modulus_n_per_mm2", "poisson_ratio", "density_kg_per_m3", "yield_strength_n_per_mm2"];
    let fields = if room == Room::Program { &fields[..3] } else { &fields };
    for field in fields {
        if let Some((value, part)) = material.number(&format!("/{field}")) {
            writer.offer(&format!("/{}/{field}", room.work()), value, vec![part]);
        }
    }
}

/// A number of the tool: its field, or what its codes say.
pub(super) fn of_tool(
    tool: &View<'_>,
    field: &'static str,
    pointer: &str,
    writer: &mut Writer<'_>,
) -> Option<(f64, Part)> {
    let codes = &tool.codes;
    let both = |of: fn(&crate::iso::Geometry) -> Option<f64>| codes.geometry.as_ref().and_then(of);
    let by_code = match field {
        "nose_radius_mm" => codes.insert.as_ref().and_then(crate::iso::Insert::nose_radius_mm),
        "cutting_edge_angle_deg" => codes.holder.as_ref().and_then(crate::iso::Holder::cutting_edge_angle_deg),
        "minor_edge_angle_deg" => both(|geometry| geometry.minor_edge_angle_deg),
        _ => None,
    };
    let stated = tool.number(&format!("/{field}"));
    if let (Some((value, _)), Some(of_code)) = (&stated, by_code)
        && (value - of_code).abs() > 1e-9 * of_code.abs()
    {
        writer.warn(
            Finding::new("contradicts_code", pointer)
                .with("value", *value)
                .with("of_code", of_code)
                .with("tool", tool.name().to_owned()),
        );
    }
    stated.or_else(|| {
        let (path, source) = match field {
            "nose_radius_mm" => ("/insert", "iso1832"),
            _ if codes.holder.as_ref().is_some_and(|holder| holder.bar.is_some()) => ("/holder", "iso6261"),
            _ => ("/holder", "iso5608"),
        };
        let value = by_code?;
        Some((value, Part::sourced(From::Tool, source, "confirmed").at(path).worth(value)))
    })
}

/// What each force model takes of the tool's geometry.
fn geometry(tool: &View<'_>, writer: &mut Writer<'_>) {
    let fields: &[&'static str] = match writer.word("/force/kind") {
        Some("kienzle") => &["nose_radius_mm", "cutting_edge_angle_deg"],
        Some("handbook") => &["cutting_edge_angle_deg", "rake_angle_deg"],
        Some("power_law") => &["cutting_edge_angle_deg"],
        _ => &[],
    };
    for field in fields {
        let pointer = format!("/force/{field}");
        if let Some((value, part)) = of_tool(tool, field, &pointer, writer) {
            writer.offer(&pointer, value, vec![part]);
        }
    }
}

/// The handbook's class with the property that its correction asks for.
fn handbook(material: &View<'_>, writer: &mut Writer<'_>) {
    let Some((class, from)) = material.at("/work_material").map(|(class, from)| (class.clone(), from)) else {
        return without_law(material, "handbook", writer);
    };
    writer.offer("/force/work_material", class.clone(), vec![Part::new(from).at("/work_material")]);
    let (field, paths) = match class.as_str() {
        Some("steel") => {
            ("tensile_strength_n_per_mm2", ["/tensile_strength_n_per_mm2", "/group_tensile_strength_n_per_mm2"])
        }
        Some("grey_iron" | "malleable_iron") => ("brinell_hardness", ["/brinell_hardness", "/group_brinell_hardness"]),
        _ => return,
    };
    if let Some((value, part)) = paths.into_iter().find_map(|path| material.number(path)) {
        writer.offer(&format!("/force/{field}"), value, vec![part]);
    }
}

fn rows_of<'v>(material: &'v View<'_>) -> Vec<Row<'v>> {
    material.record().map(kienzle::rows).unwrap_or_default()
}

/// What a job says of the row that it wants.
fn choice(writer: &mut Writer<'_>) -> (Option<usize>, Option<String>) {
    let row = writer.take("/force", "kienzle_row").and_then(|row| row.as_u64());
    let source = writer.take("/force", "source").and_then(|source| source.as_str().map(str::to_owned));
    (row.and_then(|row| usize::try_from(row).ok()), source)
}

fn of_kienzle(room: Room, views: &Views<'_>, writer: &mut Writer<'_>) {
    let (row, source) = choice(writer);
    let normal_force = writer.take("/force", "normal_force");
    let Some(material) = views.material_of_force() else { return };
    let rows = rows_of(material);
    let asked = match (row, source.as_deref()) {
        (Some(index), _) => Choice::Row(index),
        (_, Some(source)) => Choice::Source(source),
        _ => Choice::Preferred,
    };
    let Some(sources) = kienzle::choose(&rows, asked) else {
        if rows.is_empty() {
            return without_law(material, "kienzle", writer);
        }
        let (field, allowed): (_, Vec<String>) = match asked {
            Choice::Row(_) => ("kienzle_row", rows.iter().map(|row| row.index.to_string()).collect()),
            _ => ("source", rows.iter().map(|row| row.source.to_owned()).collect()),
        };
        writer.fault(
            Finding::new("unknown_kienzle_row", format!("/force/{field}"))
                .with("material", material.name().to_owned())
                .with("allowed", allowed),
        );
        return;
    };
    cutting(room, views, &sources, writer);
    let judged = normal(material, &sources.used, normal_force.as_ref(), writer);
    if room == Room::Deflection {
        uncertainty(&sources, judged, writer);
    }
    conflict(material, &sources, writer);
}

fn part_of(row: &Row<'_>) -> Part {
    Part::sourced(From::Material, row.source, row.certainty).at(format!("/kienzle/{}", row.index))
}

/// k_c1.1, at the tool's rake where tool and row say theirs, and m_c.
fn cutting(room: Room, views: &Views<'_>, sources: &Sources<'_>, writer: &mut Writer<'_>) {
    let row = &sources.used;
    let rake = views.tool.as_ref().and_then(|tool| tool.number("/rake_angle_deg")).map(|(value, _)| value);
    let factor = rake.and_then(|rake| row.rake_factor(rake));
    let mut force = row.specific_cutting_force_n_per_mm2;
    let mut part = part_of(row);
    if let (Some(factor), Some(rake)) = (factor, rake) {
        force *= factor;
        part = part.by("library/2");
        writer.explain(Message::new("library_rake_corrected").with("rake_deg", rake).with("factor", factor));
    } else if let Some(rake) = rake {
        writer.explain(Message::new("library_rake_not_corrected").with("rake_deg", rake));
    }
    let own = writer.at("/force/specific_cutting_force_n_per_mm2").is_some();
    writer.offer("/force/specific_cutting_force_n_per_mm2", force, vec![part.clone().worth(force)]);
    let exponent = row.cutting_exponent;
    writer.offer("/force/cutting_exponent", exponent, vec![part_of(row).worth(exponent)]);
    if !own && room != Room::Ring {
        writer.offer("/force/certainty", row.certainty.to_owned(), vec![part_of(row).worth(row.certainty.to_owned())]);
    }
}

/// The normal force: of the row, where it was measured; judged, where the job says so; never else. Whether it is judged.
fn normal(material: &View<'_>, row: &Row<'_>, word: Option<&Value>, writer: &mut Writer<'_>) -> bool {
    const FIELDS: [&str; 2] = ["/force/specific_normal_force_n_per_mm2", "/force/normal_exponent"];
    if let Some((force, exponent)) = row.normal {
        for (field, value) in FIELDS.into_iter().zip([force, exponent]) {
            writer.offer(field, value, vec![part_of(row).worth(value)]);
        }
        return false;
    }
    if FIELDS.into_iter().all(|field| writer.at(field).is_some()) {
        return false;
    }
    let group = material.text("iso513_group");
    let judged = (word.and_then(Value::as_str) == Some("judged"))
        .then(|| kienzle::judged_normal_force(group?, row.specific_cutting_force_n_per_mm2, row.cutting_exponent));
    let Some((force, exponent)) = judged.flatten() else {
        let missing = FIELDS.into_iter().find(|field| writer.at(field).is_none()).unwrap_or(FIELDS[0]);
        writer.fault(Finding::new("passive_force_missing", missing).with("judged", "judged"));
        return false;
    };
    let part = || Part::sourced(From::Material, "judgement", "judgement").by("library/6");
    for (field, value) in FIELDS.into_iter().zip([force, exponent]) {
        writer.offer(field, value, vec![part().worth(value)]);
    }
    writer.warn(
        Finding::new("judged_normal_force", FIELDS[0])
            .value(force, "N/mm2")
            .with("group", group.unwrap_or_default().to_owned()),
    );
    true
}

/// Where a job says how well its cutting force is known.
pub(super) const FORCE_PERCENT: &str = "/uncertainty/force_percent";

/// How well the force is known.
fn uncertainty(sources: &Sources<'_>, judged: bool, writer: &mut Writer<'_>) {
    let mut percent = sources.force_percent;
    let mut part = part_of(&sources.used).by("library/3");
    if judged && percent < JUDGED_FORCE_PERCENT {
        percent = JUDGED_FORCE_PERCENT;
        part = Part::sourced(From::Material, "judgement", "judgement").by("library/6");
    }
    writer.offer(FORCE_PERCENT, percent, vec![part.worth(percent)]);
}

/// What the other sources say, where they differ.
fn conflict(material: &View<'_>, sources: &Sources<'_>, writer: &mut Writer<'_>) {
    if !sources.is_conflict() {
        return;
    }
    let used = sources.used.at_reference();
    let far = |row: &Row<'_>| (row.at_reference() / used).ln().abs();
    let other = if far(&sources.least) > far(&sources.largest) { &sources.least } else { &sources.largest };
    let said = |row: &Row<'_>| part_of(row).source.unwrap_or_default();
    let words = |finding: Message| {
        finding
            .with("material", material.name().to_owned())
            .with("used_n_per_mm2", used)
            .with("used_source", said(&sources.used))
            .with("other_n_per_mm2", other.at_reference())
            .with("other_source", said(other))
            .with("differs_percent", sources.differs_percent)
    };
    writer.explain(words(Message::new("library_force_sources")));
    let message = words(Message::new("force_sources_differ"));
    let mut finding = Finding::new(message.code, "/force/specific_cutting_force_n_per_mm2");
    finding.values = message.values;
    writer.warn(finding);
}

/// A material that has no such law, with the laws that it has.
fn without_law(material: &View<'_>, law: &'static str, writer: &mut Writer<'_>) {
    let mut has = Vec::new();
    if !rows_of(material).is_empty() {
        has.push("kienzle");
    }
    if material.at("/work_material").is_some() {
        has.push("handbook");
    }
    let mut fault = Finding::new("material_without_force_law", material.pointer.clone())
        .with("material", material.name().to_owned())
        .with("law", law)
        .with("has", has);
    if !material.rows("kienzle").is_empty() {
        fault = fault.with("without_exponent", "yes");
    }
    writer.fault(fault);
}
