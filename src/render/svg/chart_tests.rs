//! Roundness charts, maps, bars and logarithmic axes.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::f64::consts::TAU;

use precut_calc::calculator::{Axis, Figure, Frame, Glyph, Item, Message, Panel, Role};

use super::svg;
use super::tests::{assert_sound, draw_to_look_at, words};

fn figure(frame: Frame, title: &'static str, x: Axis, panels: Vec<Panel>) -> Figure {
    Figure { id: "chart", title: Message::new(title), frame, x, panels }
}

fn drawn(name: &str, figure: &Figure) -> String {
    let text = svg(figure, &words());
    draw_to_look_at(name, &text);
    assert_sound(&text);
    assert_eq!(text, svg(figure, &words()), "the same bytes every time");
    text
}

/// The profile of a ring before and after turning on two supports.
fn ring(samples: u32) -> Figure {
    let angles: Vec<f64> = (0..samples).map(|k| 360.0 * f64::from(k) / f64::from(samples)).collect();
    let lobes = |order: f64, size: f64, shift: f64, angle: &f64| size * (order * (angle - shift) / 360.0 * TAU).cos();
    let before = |a: &f64| 22.0 * (a / 360.0 * TAU * 2.0).cos() + lobes(5.0, 6.0, 20.0, a) + lobes(37.0, 1.2, 3.0, a);
    let after = |a: &f64| lobes(3.0, 4.0, 40.0, a) + lobes(50.0, 0.8, 1.0, a);
    let line = |name, role, of: &dyn Fn(&f64) -> f64| Item::Line {
        name,
        x: angles.clone(),
        y: angles.iter().map(|a| Some(of(a))).collect(),
        role,
    };
    let glyph = |glyph, x, y| Item::Glyph { glyph, x, y };
    let whole = vec![0.0, 360.0];
    let items = vec![
        Item::Band {
            name: "tolerance",
            x: whole.clone(),
            lower: vec![-10.0; 2],
            upper: vec![10.0; 2],
            role: Role::Tolerance,
        },
        line("profile_before", Role::Before, &before),
        line("profile_after", Role::After, &after),
        Item::Line { name: "least_squares_circle", x: whole, y: vec![Some(0.4); 2], role: Role::Comparison },
        glyph(Glyph::SteadyRest, 235.0, after(&235.0)),
        glyph(Glyph::SteadyRest, 325.0, after(&325.0)),
        glyph(Glyph::Tool, 90.0, after(&90.0)),
    ];
    let panel = Panel { y: Axis::linear("deviation", "um"), height: 1.0, items };
    figure(Frame::Polar, "roundness_before_and_after", Axis::linear("angle", "deg"), vec![panel])
}

/// A shaft with what binds below it: one limit in the first zone, two in the second.
#[test]
fn ribbons_say_what_holds_by_colour_pattern_letter_and_name() {
    let outline = Item::Outline {
        name: "part",
        x: vec![0.0, 100.0, 100.0, 0.0],
        y: vec![-5.0, -5.0, 5.0, 5.0],
        role: Role::Part,
    };
    let ribbon = |name, role, stretches: &[(f64, f64, f64, &str)]| Item::Ribbon {
        name,
        x: stretches.iter().map(|stretch| stretch.0).collect(),
        x_end: stretches.iter().map(|stretch| stretch.1).collect(),
        weight: stretches.iter().map(|stretch| stretch.2).collect(),
        places: stretches.iter().map(|stretch| stretch.3.to_owned()).collect(),
        role,
    };
    let ribbons = vec![
        ribbon("deflection", Role::Series(0), &[(0.0, 90.0, 0.4, "z1"), (90.0, 100.0, 0.09, "z2")]),
        ribbon("a_name_far_too_long_for_its_stretch_of_the_shaft", Role::Series(2), &[(90.0, 100.0, 0.01, "z2")]),
    ];
    let panels = vec![
        Panel { y: Axis::linear("radius", "mm"), height: 1.0, items: vec![outline] },
        Panel { y: Axis::linear("gain", "percent"), height: 0.5, items: ribbons },
    ];
    let text = drawn("ribbon", &figure(Frame::Stacked, "what_binds", Axis::linear("station", "mm"), panels));
    let count = |piece: &str| text.matches(piece).count();
    // Three pieces; two entries of the legend.
    assert_eq!((count("class=\"ribbon n0\""), count("class=\"ribbon n2\"")), (3, 2));
    assert_eq!((count("class=\"weave-2 n2\""), count("class=\"weave-0")), (2, 0), "a pattern, but for the plain one");
    assert_eq!(count(">deflection</text>"), 3, "the name where it has room, and in the legend");
    assert_eq!(count(">C</text>"), 2, "the letter where the name has none, and in the legend");
    assert!(text.contains("<title>z2: deflection, 0.09"), "{text}");
    // Weights of 9 to 1: the lightest still has a readable share, the heaviest lies above it.
    let heights: Vec<f64> = text
        .split("<rect class=\"ribbon ")
        .skip(1)
        .map(|rect| rect.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
        .filter(|height: &f64| (height - 12.0).abs() > 1e-9)
        .collect();
    let [whole, upper, lower] = heights[..] else { panic!("{heights:?}") };
    assert!((upper + lower - whole).abs() < 0.02 && upper > 2.0 * lower && lower > 0.2 * whole, "{heights:?}");
    // No numbers beside ribbons: what they weigh is no height.
    let numbers = text.split("<g class=\"number\" text-anchor=\"end\">").last().unwrap().split("</g>").next().unwrap();
    assert_eq!(numbers, "");
}

#[test]
fn a_roundness_chart_says_its_scale_and_closes() {
    let text = drawn("ring", &ring(3600));
    assert!(text.len() < 150_000, "{} bytes", text.len());
    for piece in
        [">chart division = 10\u{a0}µm</text>", ">90°</text>", ">330°</text>", ">deviation, µm</text>", ">−20</text>"]
    {
        assert!(text.contains(piece), "no {piece}");
    }
    let few = svg(&ring(36), &words());
    let d = few.split("class=\"line before\" d=\"M").last().unwrap();
    let d = &d[..d.find('"').unwrap()];
    assert_eq!(d.split('L').next(), d.split('L').next_back(), "it ends where it began");
}

/// Growth of vibration over spindle speed and depth, with lobes like those of a milling cutter.
fn lobes(columns: u32, rows: u32, diverging: bool) -> Figure {
    let x: Vec<f64> = (0..columns).map(|k| 500.0 + 9500.0 * f64::from(k) / f64::from(columns)).collect();
    let y: Vec<f64> = (0..rows).map(|k| 0.05 + 6.0 * f64::from(k) / f64::from(rows)).collect();
    let limit = |speed: f64| 1.1 + 2.2 * (1.0 - (60.0 * 400.0 / speed).fract()).powi(4) * (speed / 5000.0);
    let growth =
        |speed: f64, depth: f64| if diverging { (depth / limit(speed)).ln() } else { depth * depth / limit(speed) };
    let values = y
        .iter()
        .flat_map(|depth| x.iter().map(move |speed| (depth * speed < 50_000.0).then(|| growth(*speed, *depth))))
        .collect();
    let curve = |name, role, of: &dyn Fn(f64) -> f64| Item::Line {
        name,
        x: x.clone(),
        y: x.iter().map(|s| Some(of(*s))).collect(),
        role,
    };
    let items = vec![
        Item::HeatMap { value: Axis::linear("growth_per_tooth", "1"), x: x.clone(), y, values, diverging },
        curve("chatter_limit", Role::Limit, &|s| limit(s).min(6.0)),
        curve("joint_opens", Role::Series(0), &|s| 2.5 + s / 9000.0),
        curve("power", Role::Series(1), &|s| (30_000.0 / s).min(6.0)),
        Item::Points { name: "working_point", x: vec![3150.0], y: vec![0.8], role: Role::Command },
    ];
    let panel = Panel { y: Axis::linear("depth", "mm"), height: 1.0, items };
    figure(Frame::Stacked, "stability_lobes", Axis::linear("spindle_speed", "rpm"), vec![panel])
}

#[test]
fn a_large_map_stays_small() {
    for (name, diverging) in [("lobes-growth", true), ("lobes-size", false)] {
        let text = drawn(name, &lobes(200, 100, diverging));
        assert!(text.len() < 120_000, "{} bytes", text.len());
        assert!(text.contains(">growth per tooth</text>") && text.contains(">chatter limit</text>"));
        assert_eq!(text.contains("precut-hatch\""), diverging, "growth is hatched, as both sides are equally dark");
    }
}

/// No worse than one small rectangle for each cell.
#[test]
fn a_map_of_noise_stays_bounded() {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(state >> 40).unwrap())
    };
    let values = (0..20_000).map(|_| Some(random())).collect();
    let (x, y) = ((0..200).map(f64::from).collect(), (0..100).map(f64::from).collect());
    let map = Item::HeatMap { value: Axis::linear("v", "1"), x, y, values, diverging: false };
    let panel = Panel { y: Axis::linear("y", "1"), height: 1.0, items: vec![map] };
    let text = drawn("noise", &figure(Frame::Stacked, "noise", Axis::linear("x", "1"), vec![panel]));
    assert!(text.len() < 800_000, "{} bytes", text.len());
}

#[test]
fn maps_of_one_number_or_none_are_maps() {
    for values in [vec![Some(3.0)], vec![None], vec![Some(f64::NAN)], vec![]] {
        for value in [Axis::linear("v", "1"), Axis::logarithmic("v", "1")] {
            let map = Item::HeatMap { value, x: vec![1.0], y: vec![2.0], values: values.clone(), diverging: true };
            let panel = Panel { y: Axis::linear("y", "1"), height: 1.0, items: vec![map] };
            drawn("one-cell", &figure(Frame::Stacked, "one", Axis::linear("x", "1"), vec![panel]));
        }
    }
}

/// Harmonics before and after over a power spectrum on logarithmic axes.
fn spectrum() -> Figure {
    let orders: Vec<f64> = (2..=30).map(f64::from).collect();
    let bars = |name, role, of: &dyn Fn(f64) -> f64| Item::Bars {
        name,
        x: orders.clone(),
        y: orders.iter().map(|k| Some(of(*k))).collect(),
        role,
    };
    let fine: Vec<f64> = (1..2000).map(f64::from).collect();
    let decay = |n: f64| 40.0 / n.powf(1.7) * (1.0 + 0.4 * n.sin());
    let line = Item::Line {
        name: "amplitude",
        x: fine.clone(),
        y: fine.iter().map(|n| Some(decay(*n))).collect(),
        role: Role::Plain,
    };
    let limit = Item::Line { name: "noise_floor", x: vec![1.0, 2000.0], y: vec![Some(2e-3); 2], role: Role::Limit };
    let filter = Item::Band {
        name: "filtered_out",
        x: vec![200.0, 2000.0],
        lower: vec![1e-4; 2],
        upper: vec![40.0; 2],
        role: Role::Unstable,
    };
    let kept = Item::Band {
        name: "kept",
        x: vec![1.0, 200.0],
        lower: vec![1e-4; 2],
        upper: vec![40.0; 2],
        role: Role::Stable,
    };
    let log = Panel { y: Axis::logarithmic("amplitude", "um"), height: 1.0, items: vec![kept, filter, line, limit] };
    let grouped = Panel {
        y: Axis::linear("amplitude", "um"),
        height: 0.8,
        items: vec![
            bars("before", Role::Before, &|k| 20.0 / k),
            bars("after", Role::After, &|k| if k > 4.0 { -3.0 / k } else { 8.0 }),
        ],
    };
    let series = |n: u8| {
        let y = fine.iter().map(|x| Some((x / 300.0 + f64::from(n)).sin() + f64::from(n))).collect();
        Item::Line {
            name: ["a", "b", "c", "d", "e", "f", "g", "h", "i"][usize::from(n)],
            x: fine.clone(),
            y,
            role: Role::Series(n),
        }
    };
    let family = Panel { y: Axis::linear("family", "1"), height: 0.8, items: (0..9).map(series).collect() };
    let mut figure = figure(Frame::Stacked, "spectrum", Axis::logarithmic("order", "1"), vec![log, grouped, family]);
    figure.title = Message::new("harmonics_before_and_after");
    figure
}

#[test]
fn logarithmic_axes_have_decades() {
    let text = drawn("spectrum", &spectrum());
    for piece in [
        ">0.001</text>",
        ">10</text>",
        ">1000</text>",
        "class=\"grid fine\"",
        "class=\"band unstable\"",
        "class=\"hatch\"",
    ] {
        assert!(text.contains(piece), "no {piece}");
    }
}

#[test]
fn what_is_not_positive_is_a_gap_on_a_logarithmic_axis() {
    let y = vec![Some(1.0), Some(10.0), Some(0.0), Some(5.0), Some(50.0), Some(-3.0)];
    let line = Item::Line { name: "a", x: (1..=6).map(f64::from).collect(), y, role: Role::After };
    let panel = Panel { y: Axis::logarithmic("y", "1"), height: 1.0, items: vec![line] };
    let text = drawn("gaps", &figure(Frame::Stacked, "gaps", Axis::linear("x", "1"), vec![panel]));
    let d = text.split("class=\"line after\" d=\"").last().unwrap();
    assert_eq!(d[..d.find('"').unwrap()].matches('M').count(), 2);
}

fn bars_of(items: Vec<Item>) -> String {
    let panel = Panel { y: Axis::linear("y", "1"), height: 1.0, items };
    drawn("bars", &figure(Frame::Stacked, "bars", Axis::linear("x", "1"), vec![panel]))
}

/// Left end of each bar of a class, px.
fn lefts(text: &str, class: &str) -> Vec<f64> {
    let d = text.split(&format!("class=\"bars {class}\" d=\"")).nth(1).unwrap();
    d[1..d.find('"').unwrap()].split('M').map(|bar| bar.split(' ').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn bars_over_one_abscissa_stand_side_by_side_and_lone_ones_in_the_middle() {
    let bars = |name, x: &[f64], role| Item::Bars { name, x: x.to_vec(), y: vec![Some(1.0); x.len()], role };
    let text = bars_of(vec![bars("a", &[1.0, 2.0, 3.0], Role::Before), bars("b", &[1.0, 3.0], Role::After)]);
    let (a, b) = (lefts(&text, "before"), lefts(&text, "after"));
    let step = a[2] - a[0];
    assert!((b[0] - a[0] - 0.2 * step).abs() < 0.02, "half of eight tenths of a step beside it");
    assert!((a[1] - a[0] - 0.5 * step).abs() < 0.02, "alone, it takes all its room: {a:?}");
}
