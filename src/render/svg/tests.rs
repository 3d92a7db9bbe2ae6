#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
use precut_calc::calculator::{Glyph, Role, Spacing};
use proptest::prelude::*;

pub(super) fn words<'a>() -> Wording<'a> {
    Wording {
        message: &|message| message.code.replace('_', " "),
        label: &|code| code.trim_start_matches("glyph_").replace('_', " "),
        unit: &|unit| unit_symbol(unit),
        decimal: '.',
    }
}

/// A stepped shaft between chuck and centre with a steady rest, and what happens to its diameter.
#[allow(clippy::cast_precision_loss)]
pub(super) fn shaft(stations: usize) -> Figure {
    let length = 2000.0;
    let x: Vec<f64> = (0..stations).map(|i| length * i as f64 / (stations - 1) as f64).collect();
    let bow = |x: f64| 61.0 * (std::f64::consts::PI * x / length).sin().powi(2) + 14.0 * (1.0 - x / length);
    let before: Vec<f64> = x.iter().map(|x| bow(*x)).collect();
    let line = |name, role, y: Vec<Option<f64>>| Item::Line { name, x: x.clone(), y, role };
    let all = |f: &dyn Fn(f64) -> f64| x.iter().map(|x| Some(f(*x))).collect::<Vec<_>>();
    let gap =
        |f: &dyn Fn(f64) -> f64| x.iter().map(|x| (!(1200.0..1260.0).contains(x)).then(|| f(*x))).collect::<Vec<_>>();
    let band = |half: f64, role, name| Item::Band {
        name,
        x: x.clone(),
        lower: x.iter().map(|_| -half).collect(),
        upper: x.iter().map(|_| half).collect(),
        role,
    };
    let upper = [(0.0, 40.0), (300.0, 40.0), (300.0, 45.0), (1700.0, 45.0), (1700.0, 38.0), (2000.0, 38.0)];
    let corners: Vec<(f64, f64)> = upper.iter().copied().chain(upper.iter().rev().map(|(x, y)| (*x, -y))).collect();
    let (px, py): (Vec<f64>, Vec<f64>) = corners.into_iter().unzip();
    let (bx, by) = (vec![0.0, 2000.0, 2000.0, 0.0], vec![48.0, 48.0, -48.0, -48.0]);
    let glyph = |glyph, x, y| Item::Glyph { glyph, x, y };
    let axis = |label, unit| Axis::linear(label, unit);
    Figure {
        id: "profile",
        title: Message::new("diameter_along_the_shaft_before_and_after_compensation"),
        frame: Frame::Stacked,
        x: axis("position_from_the_headstock", "mm"),
        panels: vec![
            Panel {
                y: axis("radius", "mm"),
                height: 0.9,
                items: vec![
                    Item::Outline { name: "blank", x: bx, y: by, role: Role::Stock },
                    Item::Outline { name: "shaft", x: px, y: py, role: Role::Part },
                    glyph(Glyph::Chuck, 0.0, 0.0),
                    glyph(Glyph::CentreRight, 2000.0, 0.0),
                    glyph(Glyph::SteadyRest, 1000.0, 45.0),
                    glyph(Glyph::FollowRest, 1450.0, 45.0),
                    glyph(Glyph::Tool, 1400.0, -45.0),
                ],
            },
            Panel {
                y: axis("compliance", "um/N"),
                height: 0.7,
                items: vec![line("compliance_at_the_tool", Role::Plain, all(&|x| bow(x) / 1950.0))],
            },
            Panel {
                y: axis("diameter_error", "um"),
                height: 1.4,
                items: vec![
                    band(12.0, Role::Tolerance, "form_tolerance"),
                    band(4.0, Role::Uncertainty, "uncertainty"),
                    line("before", Role::Before, before.iter().copied().map(Some).collect()),
                    line("paper_formula", Role::Comparison, all(&|x| bow(x) * 0.93 - 1.0)),
                    line("after", Role::After, gap(&|x| 1.4 * (x / 40.0).sin())),
                    Item::Points {
                        name: "measured",
                        x: x.iter().step_by(stations.div_ceil(20)).copied().collect(),
                        y: x.iter().step_by(stations.div_ceil(20)).map(|x| bow(*x) + 3.0 * (x / 11.0).sin()).collect(),
                        role: Role::Before,
                    },
                ],
            },
            Panel {
                y: axis("programmed_diameter", "mm"),
                height: 1.0,
                items: vec![
                    line("drawing", Role::Nominal, all(&|_| 90.0)),
                    line("command", Role::Command, gap(&|x| 90.0 - bow(x) / 1000.0)),
                ],
            },
        ],
    }
}

/// A tiny reader of XML: every tag closes, every attribute is quoted, no stray `<` or `&`.
fn well_formed(text: &str) -> Result<usize, String> {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = text;
    let mut count = 0;
    while let Some(start) = rest.find('<') {
        plain(&rest[..start])?;
        let tag_end = rest[start..].find('>').ok_or("a tag does not end")? + start;
        let tag = &rest[start + 1..tag_end];
        rest = &rest[tag_end + 1..];
        count += 1;
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes nothing"));
            }
            continue;
        }
        let (inner, alone) = tag.strip_suffix('/').map_or((tag, false), |inner| (inner, true));
        let (name, attributes) = inner.split_once(' ').unwrap_or((inner, ""));
        let quotes: Vec<&str> = attributes.split('"').collect();
        if quotes.len().is_multiple_of(2) || inner.contains('<') {
            return Err(format!("<{inner}>"));
        }
        quotes.iter().try_for_each(|part| plain(part))?;
        if !alone {
            open.push(name);
        }
    }
    plain(rest)?;
    if open.is_empty() { Ok(count) } else { Err(format!("open: {open:?}")) }
}

fn plain(text: &str) -> Result<(), String> {
    let entity = |at: usize| ["&amp;", "&lt;", "&gt;", "&quot;"].iter().any(|e| text[at..].starts_with(e));
    let stray = text.match_indices('&').any(|(at, _)| !entity(at));
    let control = text.chars().any(|c| c < ' ' && c != '\n');
    if stray || control { Err(format!("text {text:?}")) } else { Ok(()) }
}

pub(super) fn assert_sound(text: &str) {
    if let Err(fault) = well_formed(text) {
        panic!("{fault}");
    }
    for word in ["NaN", "inf", "e+", "e-"] {
        let hit = text.match_indices(" d=\"").any(|(at, _)| {
            let d = &text[at + 4..];
            d[..d.find('"').unwrap()].contains(word)
        });
        assert!(!hit, "{word} in a path");
    }
}

/// With `PRECUT_PICTURES=folder`, the pictures are left there.
pub(super) fn draw_to_look_at(name: &str, text: &str) {
    if let Ok(folder) = std::env::var("PRECUT_PICTURES") {
        std::fs::write(format!("{folder}/{name}.svg"), text).unwrap();
    }
}

#[test]
fn a_figure_is_complete_and_small() {
    let text = svg(&shaft(201), &words());
    draw_to_look_at("shaft", &text);
    assert_sound(&text);
    assert!(text.len() < 100_000, "{} bytes", text.len());
    for piece in [
        "<title>diameter along the shaft before and after compensation</title>",
        "position from the headstock, mm",
        "diameter error, µm",
        "compliance, µm/N",
        "prefers-color-scheme:dark",
        ">form tolerance</text>",
        ">steady rest</text>",
        "−40</text>",
        "role=\"img\"",
    ] {
        assert!(text.contains(piece), "no {piece}");
    }
    assert_eq!(text, svg(&shaft(201), &words()), "the same bytes every time");
}

#[test]
fn many_stations_stay_bounded() {
    let text = svg(&shaft(100_000), &words());
    assert_sound(&text);
    assert!(text.len() < 400_000, "{} bytes", text.len());
}

#[test]
fn the_caller_words_everything() {
    let russian = Wording {
        message: &|_| "Диаметр <вдоль> вала & \"допуск\"".to_owned(),
        label: &|code| {
            if code.len() % 3 == 0 {
                "погрешность диаметра после компенсации"
            } else {
                "погрешность"
            }
            .to_owned()
        },
        unit: &|_| "мкм".to_owned(),
        decimal: ',',
    };
    let text = svg(&shaft(21), &russian);
    draw_to_look_at("russian", &text);
    assert_sound(&text);
    assert!(text.contains("Диаметр &lt;вдоль&gt; вала &amp; &quot;допуск&quot;"));
    assert!(text.contains("погрешность, мкм") && text.contains("89,9"));
}

#[test]
fn gaps_break_the_line_and_single_points_show() {
    let y = vec![Some(1.0), Some(2.0), None, Some(3.0), None, Some(f64::NAN), Some(1.0), Some(2.0)];
    let x = (0..8).map(f64::from).collect();
    let text = svg(&one_item(Item::Line { name: "a", x, y, role: Role::After }), &words());
    let d = text.split("class=\"line after\" d=\"").last().unwrap();
    assert_eq!(d[..d.find('"').unwrap()].matches('M').count(), 2);
    assert_eq!(text.matches("class=\"dot after\"").count(), 1);
}

#[test]
fn names_of_one_role_differ_in_their_pattern() {
    let line = |name| Item::Line { name, x: vec![0.0, 1.0], y: vec![Some(0.0), Some(1.0)], role: Role::Plain };
    let mut figure = one_item(line("first"));
    figure.panels[0].items.push(line("second"));
    figure.panels[0].items.push(line("first"));
    let text = svg(&figure, &words());
    assert_eq!(text.matches("class=\"line plain\"").count(), 3, "twice drawn, once in the legend");
    assert_eq!(text.matches("class=\"line plain v1\"").count(), 2);
    assert_eq!(text.matches(">first</text>").count(), 1);
}

#[test]
fn an_empty_figure_is_a_figure() {
    let mut figure = one_item(Item::Points { name: "a", x: vec![], y: vec![], role: Role::Plain });
    assert_sound(&svg(&figure, &words()));
    figure.panels.clear();
    assert_sound(&svg(&figure, &words()));
}

fn one_item(item: Item) -> Figure {
    let axis = Axis::linear("x", "1");
    let panels = vec![Panel { y: axis, height: 1.0, items: vec![item] }];
    Figure { id: "one", title: Message::new("one"), frame: Frame::Stacked, x: axis, panels }
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -1e3..1e3, 1 => proptest::num::f64::ANY, 1 => Just(0.0)]
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(number(), 0..12)
}

fn role() -> impl Strategy<Value = Role> {
    proptest::sample::select(vec![
        Role::Nominal,
        Role::Before,
        Role::After,
        Role::Command,
        Role::Comparison,
        Role::Part,
        Role::Stock,
        Role::Tolerance,
        Role::Uncertainty,
        Role::Limit,
        Role::Stable,
        Role::Unstable,
        Role::Series(2),
        Role::Series(255),
        Role::Plain,
    ])
}

fn item() -> impl Strategy<Value = Item> {
    let glyph = proptest::sample::select(vec![
        Glyph::CentreLeft,
        Glyph::CentreRight,
        Glyph::Chuck,
        Glyph::SteadyRest,
        Glyph::FollowRest,
        Glyph::Tool,
    ]);
    let name = proptest::sample::select(vec!["a", "b<&>", "\u{0}c\"", "д", ""]);
    prop_oneof![
        (name.clone(), numbers(), proptest::collection::vec(proptest::option::of(number()), 0..12), role())
            .prop_map(|(name, x, y, role)| Item::Line { name, x, y, role }),
        (name.clone(), numbers(), numbers(), numbers(), role()).prop_map(|(name, x, lower, upper, role)| Item::Band {
            name,
            x,
            lower,
            upper,
            role
        }),
        (name.clone(), numbers(), numbers(), role()).prop_map(|(name, x, y, role)| Item::Points { name, x, y, role }),
        (name.clone(), numbers(), numbers(), role()).prop_map(|(name, x, y, role)| Item::Outline { name, x, y, role }),
        (name, numbers(), proptest::collection::vec(proptest::option::of(number()), 0..12), role())
            .prop_map(|(name, x, y, role)| Item::Bars { name, x, y, role }),
        (axis(), numbers(), numbers(), proptest::collection::vec(proptest::option::of(number()), 0..60), any::<bool>())
            .prop_map(|(value, x, y, values, diverging)| Item::HeatMap { value, x, y, values, diverging }),
        (glyph, number(), number()).prop_map(|(glyph, x, y)| Item::Glyph { glyph, x, y }),
    ]
}

fn axis() -> impl Strategy<Value = Axis> {
    let scale = proptest::sample::select(vec![Spacing::Linear, Spacing::Logarithmic]);
    scale.prop_map(|scale| Axis { label: "label <&>", unit: "um/N", scale })
}

proptest! {
    #[test]
    fn any_figure_is_sound(
        x in axis(),
        frame in proptest::sample::select(vec![Frame::Stacked, Frame::Polar]),
        panels in proptest::collection::vec((axis(), number(), proptest::collection::vec(item(), 0..6)), 0..4),
    ) {
        let panels: Vec<_> = panels.into_iter().map(|(y, height, items)| Panel { y, height, items }).collect();
        // Curves that jump round a chart at random are drawn in arcs.
        let bound = if frame == Frame::Polar { 1_000_000 } else { 100_000 };
        let figure = Figure { id: "any", title: Message::new("any"), frame, x, panels };
        let text = svg(&figure, &words());
        assert_sound(&text);
        prop_assert!(text.len() < bound, "{} bytes", text.len());
        prop_assert_eq!(text, svg(&figure, &words()));
    }
}
