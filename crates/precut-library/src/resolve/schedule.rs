//! Names in a feed schedule: the spindle, prices, and the ranges of feed and speed.

use std::f64::consts::PI;

use precut_calc::calculator::Finding;
use serde_json::Value;

use super::force::of_tool;
use super::origin::{From, Part};
use super::view::{View, Views};
use super::writer::Writer;
use crate::{built_in, life};

/// How far the power over the speed may be from constant torque, then constant power.
const SIMPLE: f64 = 0.05;

/// Everything but supports, carriage and force.
pub(super) fn fill(views: &Views<'_>, writer: &mut Writer<'_>) {
    if let Some(machine) = &views.machine {
        spindle(machine, writer);
    }
    if let Some(tool) = &views.tool {
        let pointer = "/cutting_edge_angle_deg";
        if let Some((angle, part)) = of_tool(tool, "cutting_edge_angle_deg", pointer, writer) {
            writer.offer(pointer, angle, vec![part]);
        }
        tool_life(views, tool, writer);
    }
    prices(views, writer);
    limits(views, writer);
}

/// Power and torque are the largest of the characteristic.
fn spindle(machine: &View<'_>, writer: &mut Writer<'_>) {
    let points = characteristic(machine);
    let part = || {
        let first = machine.rows("spindle/characteristic").first();
        let text = |name: &str| first.and_then(|row| row.get(name)).and_then(Value::as_str).unwrap_or_default();
        Part::sourced(From::Machine, text("source"), text("certainty")).at("/spindle/characteristic")
    };
    let largest = |values: Vec<f64>| values.into_iter().reduce(f64::max);
    let power = largest(points.iter().filter_map(|point| point.1).collect());
    let torque = largest(points.iter().filter_map(|point| point.2).collect());
    for (field, value) in [("power_kw", power), ("torque_n_m", torque)] {
        if let Some(value) = value {
            writer.offer(&format!("/machine/{field}"), value, vec![part().worth(value)]);
        }
    }
    if let Some(share) = power.zip(torque).and_then(|(power, torque)| beside_simple(&points, power, torque)) {
        writer.warn(
            Finding::new("spindle_characteristic_simplified", "/machine/power_kw")
                .measured(100.0 * share, 100.0 * SIMPLE, "percent")
                .with("machine", machine.name().to_owned()),
        );
    }
    for (field, path) in [
        ("efficiency", "/spindle/efficiency"),
        ("spindle_speed_min_rpm", "/spindle/speed_min_rpm"),
        ("spindle_speed_max_rpm", "/spindle/speed_max_rpm"),
        ("feed_rate_max_mm_per_min", "/travel/feed_rate_max_mm_per_min"),
    ] {
        if let Some((value, part)) = machine.number(path) {
            writer.offer(&format!("/machine/{field}"), value, vec![part]);
        }
    }
}

/// Spindle speed, rev/min, power, kW, and torque, N m.
pub(super) fn characteristic(machine: &View<'_>) -> Vec<(f64, Option<f64>, Option<f64>)> {
    let number = |row: &Value, name: &str| row.get(name).and_then(Value::as_f64);
    let points = machine.rows("spindle/characteristic").iter();
    points
        .filter_map(|row| Some((number(row, "spindle_speed_rpm")?, number(row, "power_kw"), number(row, "torque_n_m"))))
        .collect()
}

/// By how much, as a share, what a point can give is below the lesser of largest power and largest torque; `None` within
/// what counts as constant torque, then constant power.
fn beside_simple(points: &[(f64, Option<f64>, Option<f64>)], power_kw: f64, torque_n_m: f64) -> Option<f64> {
    let per_rpm = 2.0 * PI / 60_000.0; // kW of 1 N m at 1 rev/min
    let short = points.iter().filter_map(|(speed, power, torque)| {
        let of_torque = torque.map(|torque| torque * per_rpm * speed);
        let can = [*power, of_torque].into_iter().flatten().reduce(f64::min)?;
        let simple = power_kw.min(torque_n_m * per_rpm * speed);
        Some(1.0 - can / simple)
    });
    short.reduce(f64::max).filter(|short| *short > SIMPLE)
}

/// Rates and times where the objective counts them, the edge's price where it has one.
fn prices(views: &Views<'_>, writer: &mut Writer<'_>) {
    let kind = writer.word("/objective/kind").map(str::to_owned);
    let counts_life = writer.at("/models/tool_life").is_some() || writer.at("/models/library").is_some();
    if let Some(machine) = &views.machine {
        if kind.as_deref() == Some("cost")
            && let Some((rate, part)) = machine.number("/price/machine_rate_money_per_min")
        {
            writer.offer("/objective/machine_rate_per_min", rate, vec![part]);
        }
        if counts_life
            && matches!(kind.as_deref(), Some("cost" | "time"))
            && let Some((time, part)) = machine.number("/price/tool_change_time_min")
        {
            writer.offer("/objective/tool_change_time_min", time, vec![part]);
        }
    }
    let Some(tool) = views.tool.as_ref().filter(|_| counts_life && kind.as_deref() == Some("cost")) else { return };
    let edges = tool.number("/edges_per_insert").map(|(edges, _)| edges);
    let insert = tool.number("/insert_price_money").zip(edges).map(|((price, part), edges)| (price / edges, part));
    if let Some((cost, part)) = insert {
        writer.offer("/objective/edge_cost", cost, vec![part.worth(cost)]);
    }
}

/// The tool's own life, or the row of the material that is of this tool and holds for the middle of the feeds.
fn tool_life(views: &Views<'_>, tool: &View<'_>, writer: &mut Writer<'_>) {
    let pointer = "/models/tool_life";
    if let Some((model, from)) = tool.at("/tool_life") {
        let model = if model.get("life_exponent").is_some() { life::model(model, "user") } else { Some(model.clone()) };
        if let Some(model) = model {
            fill_model(pointer, &model, &Part::new(from).at("/tool_life"), writer);
        }
        return;
    }
    let (Some(word), Some(material)) = (tool.text("speed_tool"), views.material_of_force()) else { return };
    let feed = writer.number("/limits/feed_min_mm_per_rev").zip(writer.number("/limits/feed_max_mm_per_rev"));
    let middle = feed.map(|(least, largest)| (least * largest).sqrt());
    let holds = |row: &Value| {
        let end = |name: &str| row.get(name).and_then(Value::as_f64);
        middle.is_none_or(|feed| {
            end("feed_above_mm_per_rev").is_none_or(|least| feed > least)
                && end("feed_up_to_mm_per_rev").is_none_or(|largest| feed <= largest)
        })
    };
    let mut rows = material.rows("taylor").iter().enumerate();
    let of_tool = |row: &Value| row.get("tool").and_then(Value::as_str) == Some(word);
    let Some((index, row)) = rows.find(|(_, row)| of_tool(row) && holds(row)) else { return };
    let text = |name: &str| row.get(name).and_then(Value::as_str).unwrap_or_default();
    let said = built_in::source(text("source")).map_or_else(|| text("source").to_owned(), built_in::Source::text);
    let part =
        Part::sourced(From::Material, text("source"), text("certainty")).at(format!("/taylor/{index}")).by("library/5");
    if let Some(model) = life::model(row, &said) {
        fill_model(pointer, &model, &part, writer);
    }
}

/// Fills a whole model; each of its numbers has an origin.
fn fill_model(pointer: &str, model: &Value, part: &Part, writer: &mut Writer<'_>) {
    if writer.at(pointer).is_some() {
        return;
    }
    let Some(fields) = model.as_object() else { return };
    for (name, value) in fields {
        let at = format!("{pointer}/{name}");
        match value {
            Value::Number(_) => {
                writer.offer(&at, value.clone(), vec![part.clone().worth(value.clone())]);
            }
            other => {
                writer.put(&at, other.clone());
            }
        }
    }
}

/// Feeds of the tool for the kind of cut, speeds of the material for the tool's grade within those of the spindle.
fn limits(views: &Views<'_>, writer: &mut Writer<'_>) {
    let cut = writer.take("", "cut_kind").and_then(|word| word.as_str().map(str::to_owned));
    let (Some(tool), Some(material)) = (&views.tool, views.material_of_force()) else { return };
    let feeds = recommended(tool, cut.as_deref(), material);
    if let Some((index, row)) = feeds {
        for (field, name) in
            [("feed_min_mm_per_rev", "feed_low_mm_per_rev"), ("feed_max_mm_per_rev", "feed_high_mm_per_rev")]
        {
            if let Some(value) = row.get(name).and_then(Value::as_f64) {
                writer.offer(
                    &format!("/limits/{field}"),
                    value,
                    vec![row_part(From::Tool, row, &format!("/recommended/{index}"), value)],
                );
            }
        }
    }
    let speeds = speeds(tool, cut.as_deref(), material);
    if let Some((index, row)) = speeds {
        speed_limits(row, &format!("/cutting_speeds/{index}"), views, writer);
    }
    // The base of a diagnosis cuts nothing, and needs neither.
    if writer.at("/zones").is_none() {
        return;
    }
    let is_chosen = |row: &Value| row.get("cut").and_then(Value::as_str) == cut.as_deref();
    let chooses_nothing = cut.is_some() && !speeds.is_some_and(|(_, row)| is_chosen(row));
    let lacks = |[least, most]: [&str; 2]| [least, most].iter().any(|at| writer.at(at).is_none());
    let no_feeds = lacks(["/limits/feed_min_mm_per_rev", "/limits/feed_max_mm_per_rev"]) || chooses_nothing;
    let no_speeds = lacks(["/limits/speed_min_m_per_min", "/limits/speed_max_m_per_min"]);
    if feeds.is_none() && no_feeds {
        writer.fault(no_recommended_feed(tool, cut, material));
    }
    if speeds.is_none() && no_speeds {
        writer.fault(no_recommended_speed(tool, material));
    }
}

/// Nothing says between which feeds the tool cuts, or the kind of cut that is asked for is none of those it has feeds for.
fn no_recommended_feed(tool: &View<'_>, cut: Option<String>, material: &View<'_>) -> Finding {
    let group = material.text("iso513_group");
    let rows = tool.rows("recommended").iter();
    let of_group = rows.filter(|row| row.get("iso513_group").and_then(Value::as_str) == group);
    let finding = Finding::new("no_recommended_feed", "/cut_kind").with("tool", tool.name().to_owned());
    let finding = with_words(finding, of_group, "cut");
    let finding = group.into_iter().fold(finding, |finding, group| finding.with("group", group.to_owned()));
    cut.into_iter().fold(finding, |finding, cut| finding.with("received", cut))
}

/// Nothing says how fast such a tool cuts the material.
fn no_recommended_speed(tool: &View<'_>, material: &View<'_>) -> Finding {
    let rows = material.rows("cutting_speeds").iter();
    let of_turning = rows.filter(|row| row.get("operation").and_then(Value::as_str) == Some("turning"));
    let finding = Finding::new("no_recommended_speed", format!("{}/speed_tool", tool.pointer))
        .with("material", material.name().to_owned());
    with_words(finding, of_turning, "tool")
}

/// What rows have in a field, each word once, as what can be chosen; left out where there is nothing.
fn with_words<'v>(finding: Finding, rows: impl Iterator<Item = &'v Value>, field: &str) -> Finding {
    let mut words: Vec<String> = rows.filter_map(|row| row.get(field)?.as_str().map(str::to_owned)).collect();
    words.sort();
    words.dedup();
    if words.is_empty() { finding } else { finding.with("allowed", words) }
}

fn row_part(from: From, row: &Value, path: &str, value: f64) -> Part {
    let text = |name: &str| row.get(name).and_then(Value::as_str).unwrap_or_default();
    Part::sourced(from, text("source"), text("certainty")).at(path).worth(value)
}

fn recommended<'v>(tool: &'v View<'_>, cut: Option<&str>, material: &View<'_>) -> Option<(usize, &'v Value)> {
    let group = material.text("iso513_group")?;
    let fits = |row: &Value| {
        let is = |name: &str, word: &str| row.get(name).and_then(Value::as_str) == Some(word);
        cut.is_some_and(|cut| is("cut", cut)) && is("iso513_group", group)
    };
    tool.rows("recommended").iter().enumerate().find(|(_, row)| fits(row))
}

/// Rows of speeds say the tool in words: what the tool itself says, of carbide the coated one of its group's letter.
fn speeds<'v>(tool: &View<'_>, cut: Option<&str>, material: &'v View<'_>) -> Option<(usize, &'v Value)> {
    let grade = tool.word("/iso513_grade").map(|(grade, _)| grade.to_owned());
    let word = tool.text("speed_tool").map(str::to_owned).or_else(|| match grade?.as_str() {
        "HSS" => Some("hss".to_owned()),
        grade => Some(format!("coated_cvd_{}", grade.chars().next()?.to_ascii_lowercase())),
    })?;
    let fits = |row: &Value, cut: &str| {
        let is = |name: &str, word: &str| row.get(name).and_then(Value::as_str) == Some(word);
        is("operation", "turning") && is("cut", cut) && is("tool", &word)
    };
    let rows = || material.rows("cutting_speeds").iter().enumerate();
    let of_cut = cut.and_then(|cut| rows().find(|(_, row)| fits(row, cut)));
    of_cut.or_else(|| rows().find(|(_, row)| fits(row, "general")))
}

/// The recommended speeds as far as the spindle reaches them at the zones' diameters.
fn speed_limits(row: &Value, path: &str, views: &Views<'_>, writer: &mut Writer<'_>) {
    let number = |name: &str| row.get(name).and_then(Value::as_f64);
    let (Some(low), Some(high)) = (number("low_m_per_min"), number("high_m_per_min")) else { return };
    let diameters: Vec<(usize, f64)> = writer
        .items("/zones")
        .iter()
        .enumerate()
        .filter_map(|(index, zone)| Some((index, zone.get("diameter_mm")?.as_f64()?)))
        .filter(|(_, diameter)| *diameter > 0.0)
        .collect();
    let speed = |diameter: f64, rpm: f64| PI * diameter * rpm / 1000.0;
    let spindle = |path: &str| views.machine.as_ref().and_then(|machine| machine.number(path));
    let (fastest, slowest) = (spindle("/spindle/speed_max_rpm"), spindle("/spindle/speed_min_rpm"));
    let explicit = ["/limits/speed_min_m_per_min", "/limits/speed_max_m_per_min"].map(|at| writer.at(at).is_some());
    if explicit == [false, false] {
        let rpm = (fastest.as_ref().map(|fastest| fastest.0), slowest.as_ref().map(|slowest| slowest.0));
        for (index, diameter) in &diameters {
            let reached =
                (slowest.as_ref().map(|s| speed(*diameter, s.0)), fastest.as_ref().map(|f| speed(*diameter, f.0)));
            if reached.1.is_some_and(|most| most < low) || reached.0.is_some_and(|least| least > high) {
                do_not_meet(*index, (low, high), reached, rpm, path, writer);
            }
        }
    }
    let part = |value: f64| row_part(From::Material, row, path, value);
    let widest = diameters.iter().map(|(_, diameter)| *diameter).reduce(f64::max);
    let narrowest = diameters.iter().map(|(_, diameter)| *diameter).reduce(f64::min);
    let of_spindle = |end: &Option<(f64, Part)>, diameter: Option<f64>| {
        end.as_ref().zip(diameter).map(|((rpm, part), diameter)| (speed(diameter, *rpm), part.clone()))
    };
    let tightest = |own: f64, machine: Option<(f64, Part)>, is_tighter: fn(f64, f64) -> bool| match machine {
        Some((limit, of_machine)) if is_tighter(limit, own) => (limit, vec![of_machine.worth(limit), part(own)]),
        Some((limit, of_machine)) => (own, vec![part(own), of_machine.worth(limit)]),
        None => (own, vec![part(own)]),
    };
    let least = tightest(low, of_spindle(&slowest, narrowest), |limit, own| limit > own);
    let most = tightest(high, of_spindle(&fastest, widest), |limit, own| limit < own);
    writer.offer("/limits/speed_min_m_per_min", least.0, least.1);
    writer.offer("/limits/speed_max_m_per_min", most.0, most.1);
}

/// A fault: no speed is both recommended and reached; with the diameter from which on one is.
fn do_not_meet(
    zone: usize,
    (low, high): (f64, f64),
    (least, most): (Option<f64>, Option<f64>),
    (fastest_rpm, slowest_rpm): (Option<f64>, Option<f64>),
    path: &str,
    writer: &mut Writer<'_>,
) {
    let too_slow = most.is_some_and(|most| most < low);
    let (reached, wanted, spindle_rpm, of_machine) = if too_slow {
        (most, low, fastest_rpm, "/spindle/speed_max_rpm")
    } else {
        (least, high, slowest_rpm, "/spindle/speed_min_rpm")
    };
    let (Some(reached), Some(rpm)) = (reached, spindle_rpm) else { return };
    writer.fault(
        Finding::new("limits_do_not_meet", format!("/zones/{zone}/diameter_mm"))
            .measured(reached, wanted, "m/min")
            .with("low", low)
            .with("high", high)
            .with("diameter_mm", 1000.0 * wanted / (PI * rpm))
            .with("too", if too_slow { "slow" } else { "fast" })
            .with("machine_path", of_machine)
            .with("material_path", path.to_owned()),
    );
}
