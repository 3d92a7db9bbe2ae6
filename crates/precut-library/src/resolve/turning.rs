//! Lathe and bar in jobs with a shaft: what holds it, the carriage, the control, and what the machine can take.

use std::f64::consts::PI;

use precut_calc::calculator::{Finding, Message};
use serde_json::Value;

use super::kinds::Room;
use super::origin::{From, Part};
use super::view::{View, Views};
use super::writer::Writer;
use crate::kienzle::of_certainty_percent;

/// Supports, carriage, control, travel and stored model.
pub(super) fn fill(room: Room, calculator: &str, views: &Views<'_>, writer: &mut Writer<'_>) {
    let mut known = Known::default();
    if let Some(machine) = &views.machine {
        supports(machine, writer, &mut known);
    }
    drop_rests(writer);
    carriage(views, writer, &mut known);
    if let Some(machine) = &views.machine {
        if room != Room::Program {
            // How a program is to be read is said with it, and never guessed.
            control(room, machine, writer);
        }
        travel(room, machine, writer);
        model(calculator, machine, writer);
    }
    if calculator == "deflection-compensation" {
        known.say(writer);
    }
}

/// How well the compliances that were filled in are known, and which machine they are of.
#[derive(Default)]
struct Known {
    /// Percent, with the path in the record.
    worst: Option<(f64, String)>,
}

impl Known {
    fn add(&mut self, part: &Part) {
        if part.from != From::Machine {
            return;
        }
        let of_certainty = || part.certainty.as_deref().map_or(0.0, of_certainty_percent);
        let percent = part.relative_standard_uncertainty_percent.unwrap_or_else(of_certainty);
        if self.worst.as_ref().is_none_or(|(worst, _)| percent > *worst) {
            self.worst = Some((percent, part.path.clone().unwrap_or_default()));
        }
    }

    fn say(self, writer: &mut Writer<'_>) {
        let Some((percent, path)) = self.worst else { return };
        let part = Part::new(From::Machine).at(path).worth(percent);
        writer.offer("/uncertainty/stiffness_percent", percent, vec![part]);
    }
}

/// A compliance of the machine: its own number, or its share of a static test (`deflection-compensation`, section 5).
fn compliance(machine: &View<'_>, name: &str) -> Option<(f64, Part)> {
    if let Some(found) = machine.number(&format!("/compliance/{name}")) {
        return Some(found);
    }
    let (meaning, _) = machine.at("/compliance/meaning")?;
    let (headstock, tailstock, carriage) = match meaning.as_str()? {
        "carriage_only" => (0.0, 0.0, 1.0),
        "three_springs" => (1.0, 1.0, 1.0),
        "midspan_equal" => (2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0),
        "midspan_1_2_1" => (1.0 / 1.75, 2.0 / 1.75, 1.0 / 1.75),
        "sum_equal" => (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0),
        _ => return None,
    };
    let share = match name {
        "headstock_centre_um_per_n" => headstock,
        "tailstock_centre_um_per_n" => tailstock,
        "carriage_um_per_n" => carriage,
        _ => return None,
    };
    let (stiffness, part) = machine.number("/compliance/single_stiffness_n_per_mm")?;
    let value = share * 1000.0 / stiffness;
    Some((value, part.by("deflection/5").worth(value)))
}

/// What holds the shaft, by its kind and the end at which it stands: the least z is the headstock.
fn supports(machine: &View<'_>, writer: &mut Writer<'_>, known: &mut Known) {
    let station = |support: &Value| support.get("z_mm").and_then(Value::as_f64);
    let least = writer.items("/supports").iter().filter_map(station).fold(f64::INFINITY, f64::min);
    for index in 0..writer.items("/supports").len() {
        let support = &writer.items("/supports")[index];
        let is_first = station(support).is_some_and(|z| z <= least);
        let rest = support.get("rest").and_then(Value::as_str).map(str::to_owned);
        let kind = support.get("kind").and_then(Value::as_str).unwrap_or_default().to_owned();
        let at = format!("/supports/{index}");
        let names: &[(&str, &str)] = match (kind.as_str(), is_first) {
            ("centre", true) => &[("compliance_um_per_n", "headstock_centre_um_per_n")],
            ("centre", false) => &[("compliance_um_per_n", "tailstock_centre_um_per_n")],
            ("chuck", true) => &[
                ("compliance_um_per_n", "headstock_chuck_um_per_n"),
                ("rotational_compliance_rad_per_n_mm", "headstock_chuck_rotation_rad_per_n_mm"),
            ],
            ("steady_rest" | "follow_rest", _) => {
                named_rest(machine, rest.as_deref(), &at, writer, known);
                continue;
            }
            _ => continue,
        };
        for (field, name) in names {
            fill_compliance(&format!("{at}/{field}"), compliance(machine, name), name, machine, writer, known);
        }
    }
}

fn fill_compliance(
    pointer: &str,
    found: Option<(f64, Part)>,
    name: &str,
    machine: &View<'_>,
    writer: &mut Writer<'_>,
    known: &mut Known,
) {
    match found {
        Some((value, part)) if writer.offer(pointer, value, vec![part.clone()]) => known.add(&part),
        None if writer.at(pointer).is_none() => writer.warn(
            Finding::new("machine_without_number", pointer)
                .with("machine", machine.name().to_owned())
                .with("path", format!("/compliance/{name}")),
        ),
        Some(_) | None => {}
    }
}

/// A rest by its name, or one without.
fn named_rest(machine: &View<'_>, rest: Option<&str>, at: &str, writer: &mut Writer<'_>, known: &mut Known) {
    let pointer = format!("{at}/compliance_um_per_n");
    let Some(rest) = rest else {
        let name = "steady_rest_um_per_n";
        return fill_compliance(&pointer, compliance(machine, name), name, machine, writer, known);
    };
    let path = format!("rests_um_per_n/{}", rest.replace('~', "~0").replace('/', "~1"));
    let found = machine.number(&format!("/compliance/{path}"));
    if found.is_none() {
        let rests = machine.at("/compliance/rests_um_per_n").and_then(|(value, _)| value.as_object());
        let names: Vec<String> = rests.into_iter().flatten().map(|(name, _)| name.clone()).collect();
        writer.fault(
            Finding::new("unknown_rest", format!("{at}/rest")).with("rest", rest.to_owned()).with("allowed", names),
        );
        return;
    }
    fill_compliance(&pointer, found, &path, machine, writer, known);
}

/// `rest` is a name of the machine's, no field of a support.
fn drop_rests(writer: &mut Writer<'_>) {
    for index in 0..writer.items("/supports").len() {
        writer.take(&format!("/supports/{index}"), "rest");
    }
}

/// Carriage and bar are springs in one chain: their compliances add.
fn carriage(views: &Views<'_>, writer: &mut Writer<'_>, known: &mut Known) {
    let bar = views.tool.as_ref().and_then(|tool| bar(tool, writer));
    let of_machine = |name: &str| views.machine.as_ref().and_then(|machine| compliance(machine, name));
    for (field, name) in [
        ("compliance_um_per_n", "carriage_um_per_n"),
        ("tangential_compliance_um_per_n", "carriage_tangential_um_per_n"),
    ] {
        let pointer = format!("/carriage/{field}");
        let parts: Vec<(f64, Part)> = of_machine(name).into_iter().chain(bar.clone()).collect();
        if parts.is_empty() {
            continue;
        }
        let sum = parts.iter().map(|(value, _)| value).sum::<f64>();
        let parts: Vec<Part> = parts.into_iter().map(|(_, part)| part).collect();
        if writer.offer(&pointer, sum, parts.clone()) {
            for part in &parts {
                known.add(part);
            }
            if name == "carriage_um_per_n" {
                say_carriage(views, &parts, writer);
            }
        }
    }
}

/// Compliance of a boring bar as a cantilever, um/N: w = 64 L³/(3 pi E D⁴) (`library/4`).
pub(crate) fn bar_compliance_um_per_n(overhang_mm: f64, diameter_mm: f64, modulus_n_per_mm2: f64) -> f64 {
    1000.0 * 64.0 * overhang_mm.powi(3) / (3.0 * PI * modulus_n_per_mm2 * diameter_mm.powi(4))
}

fn bar(tool: &View<'_>, writer: &mut Writer<'_>) -> Option<(f64, Part)> {
    let overhang = tool.number("/bar/overhang_mm");
    if tool.text("kind") == Some("turning_external") {
        if overhang.is_some() {
            writer.fault(Finding::new("unknown_field", "/tool/overhang_mm"));
        }
        return None;
    }
    let code = tool.codes.holder.as_ref().and_then(|holder| holder.bar);
    let diameter = tool.number("/bar/diameter_mm").map(|(value, _)| value);
    let diameter = diameter.or_else(|| code.map(|bar| f64::from(bar.diameter_mm)))?;
    let Some((overhang, _)) = overhang else {
        let mut missing = Finding::new("missing_field", "/tool/overhang_mm");
        missing.unit = Some("mm");
        writer.fault(missing);
        return None;
    };
    let (modulus, part) = tool.number("/bar/youngs_modulus_n_per_mm2").unwrap_or_else(|| {
        let material = code.map_or(crate::iso::BarMaterial::Steel, crate::iso::Bar::material);
        (material.youngs_modulus_n_per_mm2(), Part::sourced(From::Tool, "judgement", "judgement"))
    });
    if let Some((limit, _)) =
        tool.number("/bar/overhang_over_diameter_max").filter(|(limit, _)| overhang > limit * diameter)
    {
        writer.warn(
            Finding::new("bar_overhang_beyond_limit", "/carriage/compliance_um_per_n")
                .measured(overhang / diameter, limit, "1")
                .with("tool", tool.name().to_owned()),
        );
    }
    let value = bar_compliance_um_per_n(overhang, diameter, modulus);
    Some((value, Part { path: None, ..part }.by("library/4").worth(value)))
}

/// The first sentence of section 7: what the carriage is made of and how unsure it is.
fn say_carriage(views: &Views<'_>, parts: &[Part], writer: &mut Writer<'_>) {
    let Some(machine) = &views.machine else { return };
    let nm = |from: From| {
        let part = parts.iter().find(|part| part.from == from)?;
        Some(1000.0 * part.value.as_ref()?.as_f64()?)
    };
    let Some(carriage) = nm(From::Machine) else { return };
    let mut message = Message::new("library_compliance")
        .with("machine", machine.name().to_owned())
        .with("carriage_nm_per_n", carriage);
    let first = parts.iter().find(|part| part.from == From::Machine);
    if let Some(percent) = first.and_then(|part| part.relative_standard_uncertainty_percent) {
        message = message.with("percent", percent);
    }
    if let Some(certainty) = first.and_then(|part| part.certainty.clone()) {
        message = message.with("certainty", certainty);
    }
    if let Some(bar) = nm(From::Tool) {
        message = message.with("bar_nm_per_n", bar);
    }
    writer.explain(message);
}

fn control(room: Room, machine: &View<'_>, writer: &mut Writer<'_>) {
    // A schedule has an increment only with a compensated path.
    let of_schedule = || writer.at("/compensation").map(|_| "/compensation/increment_um");
    let pointer = if room == Room::Schedule { of_schedule() } else { Some("/path/increment_um") };
    if let (Some(pointer), Some((increment, part))) = (pointer, machine.number("/control/increment_um")) {
        writer.offer(pointer, increment, vec![part]);
    }
    if let Some((dialect, part)) = machine.word("/control/dialect") {
        writer.offer("/program/dialect", dialect.to_owned(), vec![part]);
    }
    let limit = machine.number("/control/spindle_limit_rpm").or_else(|| machine.number("/spindle/speed_max_rpm"));
    if let Some((limit, part)) = limit {
        writer.offer("/program/spindle_limit_rpm", limit, vec![part]);
    }
}

/// A part must find room in the machine.
fn travel(room: Room, machine: &View<'_>, writer: &mut Writer<'_>) {
    let number = |segment: &Value, field: &str| segment.get(field).and_then(Value::as_f64);
    let segments = writer.items("/shaft/segments");
    let length = segments.iter().filter_map(|segment| number(segment, "length_mm")).sum::<f64>();
    let widest = |segment: &Value| number(segment, "stock_diameter_mm").or_else(|| number(segment, "diameter_mm"));
    let diameter = segments.iter().filter_map(widest).fold(0.0, f64::max);
    let outline = writer.items("/stock/profile");
    let largest = |field: &str| outline.iter().filter_map(|row| number(row, field)).fold(0.0, f64::max);
    let (length, diameter, at) = match room {
        Room::Program => (largest("z_mm"), largest("diameter_mm"), "/stock/profile"),
        _ => (length, diameter, "/shaft/segments"),
    };
    for (value, path, quantity) in
        [(length, "/travel/between_centres_mm", "length"), (diameter, "/travel/diameter_max_mm", "diameter")]
    {
        let Some((limit, _)) = machine.number(path) else { continue };
        if value > limit {
            above(machine, at, (value, limit, "mm"), path, quantity, writer);
        }
    }
}

/// A fault: more than the machine has.
pub(super) fn above(
    machine: &View<'_>,
    pointer: &str,
    (value, limit, unit): (f64, f64, &'static str),
    path: &str,
    quantity: &'static str,
    writer: &mut Writer<'_>,
) {
    writer.fault(
        Finding::new("above_machine_limit", pointer)
            .measured(value, limit, unit)
            .with("machine", machine.name().to_owned())
            .with("path", path.to_owned())
            .with("quantity", quantity),
    );
}

/// The stored model in force, unless the job says one, or none by null.
pub(super) fn model(calculator: &str, machine: &View<'_>, writer: &mut Writer<'_>) {
    let path = format!("/models/{calculator}");
    let Some((Value::String(name), from)) = machine.at(&path) else { return };
    let name = name.clone();
    if writer.job().get("model").is_none() {
        writer.offer("/model", name, vec![Part::new(from).at(path)]);
    }
}

/// The spindle must reach the speed of the cut; at a held cutting speed it turns fastest at the smallest diameter.
pub(super) fn check_cut(views: &Views<'_>, writer: &mut Writer<'_>) {
    const PATH: &str = "/spindle/speed_max_rpm";
    let Some(machine) = &views.machine else { return };
    let Some((limit, _)) = machine.number(PATH) else { return };
    let cuts: Vec<String> = std::iter::once("/cut".to_owned())
        .chain((0..writer.items("/passes").len()).map(|index| format!("/passes/{index}")))
        .collect();
    let smallest = smallest_turned_mm(writer.items("/shaft/segments"));
    for cut in cuts {
        if let Some(speed) = writer.number(&format!("{cut}/spindle_speed_rpm")).filter(|speed| *speed > limit) {
            above(
                machine,
                &format!("{cut}/spindle_speed_rpm"),
                (speed, limit, "rev/min"),
                PATH,
                "spindle_speed",
                writer,
            );
        }
        let Some((speed, diameter)) = writer.number(&format!("{cut}/speed_m_per_min")).zip(smallest) else { continue };
        let turns = 1000.0 * speed / (PI * diameter);
        if turns > limit {
            let reached = PI * diameter * limit / 1000.0;
            above(machine, &format!("{cut}/speed_m_per_min"), (speed, reached, "m/min"), PATH, "cutting_speed", writer);
        }
    }
}

/// The smallest diameter at which something is cut, mm: of the blank, at which the cutting speed counts.
fn smallest_turned_mm(segments: &[Value]) -> Option<f64> {
    let number = |segment: &Value, field: &str| segment.get(field).and_then(Value::as_f64);
    let turned = segments.iter().filter_map(|segment| {
        let (stock, drawn) = (number(segment, "stock_diameter_mm")?, number(segment, "diameter_mm")?);
        (stock > drawn && drawn > 0.0).then_some(stock)
    });
    turned.reduce(f64::min)
}
