//! Names in jobs of a cutter and a spindle.

use precut_calc::calculator::Finding;
use serde_json::{Value, json};

use super::force::FORCE_PERCENT;
use super::kinds::Room;
use super::origin::{From, Part};
use super::view::{View, Views};
use super::writer::Writer;
use super::{schedule, turning};
use crate::kienzle::{self, Choice};

pub(super) fn fill(room: Room, calculator: &str, views: &Views<'_>, writer: &mut Writer<'_>) {
    if let Some(machine) = &views.machine {
        spindle(room, machine, writer);
        turning::model(calculator, machine, writer);
    }
    let fields = ["diameter_mm", "teeth", "helix_angle_deg", "cutting_edge_angle_deg"];
    let fields = if room == Room::Cutter { &fields[..] } else { &fields[..2] };
    for tool in views.tools() {
        for field in fields {
            if let Some((value, part)) = tool.number(&format!("/{field}")) {
                let value: Value = if *field == "teeth" { whole(value) } else { value.into() };
                writer.offer(&format!("/cutter/{field}"), value, vec![part]);
            }
        }
    }
    if let Some(material) = views.material_of_force() {
        // There a law is one of several.
        if room == Room::Cutter && writer.at("/force/kind").is_none() {
            writer.put("/force/kind", json!("power_law"));
        }
        if room != Room::Cutter || writer.at("/force/kind") == Some(&json!("power_law")) {
            force(material, writer);
        }
    }
}

/// Where a machine states its fastest speed.
const FASTEST: &str = "/spindle/speed_max_rpm";

/// A count as the integer that it is.
fn whole(value: f64) -> Value {
    serde_json::from_str(&format!("{value:.0}")).unwrap_or_else(|_| json!(value))
}

fn spindle(room: Room, machine: &View<'_>, writer: &mut Writer<'_>) {
    if let Some((value, part)) = machine.number("/spindle/efficiency") {
        writer.offer("/spindle/efficiency", value, vec![part]);
    }
    if writer.at("/spindle/characteristic").is_none() {
        let rows = machine.rows("spindle/characteristic");
        for (index, point) in schedule::characteristic(machine).iter().enumerate() {
            let row = &rows[index];
            let text = |name: &str| row.get(name).and_then(Value::as_str).unwrap_or_default();
            if index == 0 {
                writer.put("/spindle/characteristic", Value::Array(vec![json!({}); rows.len()]));
            }
            let fields = [("spindle_speed_rpm", Some(point.0)), ("power_kw", point.1), ("torque_n_m", point.2)];
            for (name, value) in fields {
                let Some(value) = value else { continue };
                let part = Part::sourced(From::Machine, text("source"), text("certainty"));
                let path = format!("/spindle/characteristic/{index}/{name}");
                writer.offer(&path, value, vec![part.at(path.clone()).worth(value)]);
            }
        }
    }
    let Some((limit, part)) = machine.number(FASTEST) else { return };
    if room == Room::Cutter {
        writer.offer("/spindle/speed_max_rpm", limit, vec![part]);
    }
    if let Some(speed) = writer.number("/cut/spindle_speed_rpm").filter(|speed| *speed > limit) {
        turning::above(machine, "/cut/spindle_speed_rpm", (speed, limit, "rev/min"), FASTEST, "spindle_speed", writer);
    }
}

/// Kienzle's law at one millimetre of depth is the law of a tooth: C_p = k_c1.1, k = m_c, mu = 0 (`fixture/2.1`).
fn force(material: &View<'_>, writer: &mut Writer<'_>) {
    let rows = material.record().map(kienzle::rows).unwrap_or_default();
    let Some(sources) = kienzle::choose(&rows, Choice::Preferred) else {
        writer.fault(
            Finding::new("material_without_force_law", material.pointer.clone())
                .with("material", material.name().to_owned())
                .with("law", "kienzle"),
        );
        return;
    };
    let row = sources.used;
    let part = |value: f64| {
        Part::sourced(From::Material, row.source, row.certainty).at(format!("/kienzle/{}", row.index)).worth(value)
    };
    let is_of_row = writer.offer(
        "/force/coefficient",
        row.specific_cutting_force_n_per_mm2,
        vec![part(row.specific_cutting_force_n_per_mm2)],
    );
    for (field, value) in [("chip_thickness_exponent", row.cutting_exponent), ("depth_exponent", 0.0)] {
        writer.offer(&format!("/force/{field}"), value, vec![part(value)]);
    }
    if is_of_row {
        writer.offer(FORCE_PERCENT, sources.force_percent, vec![part(sources.force_percent).by("library/3")]);
    }
}
