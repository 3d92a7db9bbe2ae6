//! The numbers and the equations of every example, per version of its calculator: if they change, the version must rise.
//!
//! `PRECUT_WRITE_GOLDEN=1 cargo test --test contract golden` writes them down anew; the diff belongs to the review.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use precut::engine::{Body, Given, solve_now};
use precut::registry::Registry;
use precut_calc::calculator::Unwatched;
use serde_json::{Value, json};

/// Elementary functions differ in their last digit from machine to machine, and conditions amplify it; a change of
/// physics or numerics that anybody would notice is far above.
const TOLERANCE: f64 = 1e-8;

/// Thousandths of a picture's width or height that nobody sees.
const WITHIN: f64 = 4.0;

/// Every number by its place; of a list the sum and the sum of squares, and how many there are.
fn digest(value: &Value, at: &str, into: &mut BTreeMap<String, f64>) {
    match value {
        Value::Number(number) => {
            into.insert(at.to_owned(), number.as_f64().unwrap());
        }
        Value::Array(items) if items.iter().all(|item| item.is_number() || item.is_null()) => {
            let numbers = || items.iter().filter_map(Value::as_f64);
            into.insert(format!("{at}/count"), f64::from(u32::try_from(numbers().count()).unwrap()));
            into.insert(format!("{at}/sum"), numbers().sum());
            into.insert(format!("{at}/squares"), numbers().map(|x| x * x).sum());
        }
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                digest(item, &format!("{at}/{i}"), into);
            }
        }
        Value::Object(fields) => {
            for (name, field) in fields {
                digest(field, &format!("{at}/{name}"), into);
            }
        }
        _ => {}
    }
}

/// The picture of a calculator on the start page is its main one, of the first example that has it.
#[test]
fn numbers_change_only_with_the_version_and_the_start_page_shows_them() {
    let registry = Registry::standard().unwrap();
    let mut pictures = serde_json::Map::new();
    for entry in registry.entries() {
        let meta = entry.meta();
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{}.json", meta.id));
        let (mut found, mut equations) = (BTreeMap::new(), BTreeSet::new());
        for example in meta.examples {
            let stored =
                solve_now(&registry, meta.id, Body::Json(example.job.into()), &Given::default(), &Unwatched).unwrap();
            let answer: Value = serde_json::from_slice(&stored.body).unwrap();
            digest(&answer["result"], example.id, &mut found);
            let basis = answer["basis"].as_array().unwrap();
            assert!(!basis.is_empty(), "{}: {} says by what", meta.id, example.id);
            equations.extend(basis.iter().map(|basis| basis["equation"].as_str().unwrap().to_owned()));
            if !pictures.contains_key(meta.id)
                && let Some(main) = stored.figures().unwrap().into_iter().find(|figure| figure.id == meta.figures[0])
            {
                pictures.insert(meta.id.to_owned(), json!({ "example": example.id, "figure": outcomes::small(&main) }));
            }
        }
        if std::env::var_os("PRECUT_WRITE_GOLDEN").is_some() {
            let text = serde_json::to_string_pretty(
                &json!({ "version": meta.version, "equations": equations, "numbers": found }),
            )
            .unwrap();
            std::fs::write(&file, text + "\n").unwrap();
        }
        let golden: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        assert_eq!(golden["version"], meta.version, "{}: write the golden numbers of the new version", meta.id);
        assert_eq!(golden["equations"], json!(equations), "{}: another basis", meta.id);
        let golden = golden["numbers"].as_object().unwrap();
        assert_eq!(golden.len(), found.len(), "{}: other numbers than version {} has", meta.id, meta.version);
        for (place, number) in &found {
            let before = golden.get(place).and_then(Value::as_f64).unwrap_or_else(|| panic!("{place} is new"));
            // What is nothing but rounding (residuals, sums that cancel) has no digits to keep.
            let scale = before.abs().max(1e-6);
            let rounding = place.ends_with("numerical_error_um") || place.ends_with("gap_um");
            assert!(
                rounding || (number - before).abs() <= TOLERANCE * scale,
                "{}: {place} was {before}, is {number}: raise the version",
                meta.id
            );
        }
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/app/outcomes.json");
    if std::env::var_os("PRECUT_WRITE_GOLDEN").is_some() {
        std::fs::write(&file, serde_json::to_string(&pictures).unwrap() + "\n").unwrap();
    }
    let kept: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for (id, now) in &pictures {
        assert!(
            outcomes::is_same(now, &kept[id], WITHIN),
            "the start page shows another outcome of {id}: write it anew"
        );
    }
    assert_eq!(kept.as_object().unwrap().len(), pictures.len());
}

/// Figures as the start page draws them.
mod outcomes {
    use precut_calc::calculator::{Figure, Frame, Item, Panel, Spacing};
    use serde_json::{Value, json};

    /// Most points of a curve on so small a picture, and the numbers across it.
    const POINTS: usize = 72;
    const ACROSS: f64 = 1000.0;

    /// A number as a place between the ends.
    fn place(value: f64, [low, high]: [f64; 2], spacing: Spacing) -> f64 {
        let bent = |v: f64| if spacing == Spacing::Logarithmic { v.max(f64::MIN_POSITIVE).log10() } else { v };
        let span = bent(high) - bent(low);
        (ACROSS * if span > 0.0 { (bent(value) - bent(low)) / span } else { 0.5 }).round()
    }

    /// Both ends and points evenly between them.
    fn thin<T: Copy>(values: &[T]) -> Vec<T> {
        let last = values.len().saturating_sub(1);
        if last < POINTS {
            return values.to_vec();
        }
        (0..POINTS).map(|i| values[i * last / (POINTS - 1)]).collect()
    }

    fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    }

    /// What of an item is drawn so small: places, and the values over them.
    fn across(item: &Item) -> &[f64] {
        match item {
            Item::Line { x, .. } | Item::Band { x, .. } | Item::Points { x, .. } | Item::Outline { x, .. } => x,
            _ => &[],
        }
    }

    fn up(item: &Item) -> Vec<f64> {
        match item {
            Item::Line { y, .. } => y.iter().copied().flatten().collect(),
            Item::Band { lower, upper, .. } => [lower.as_slice(), upper].concat(),
            Item::Points { y, .. } | Item::Outline { y, .. } => y.clone(),
            _ => Vec::new(),
        }
    }

    fn drawn(item: &Item, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) -> Option<Value> {
        let xs = |list: &[f64]| -> Vec<f64> { thin(list).into_iter().map(x).collect() };
        let ys = |list: &[f64]| -> Vec<f64> { thin(list).into_iter().map(y).collect() };
        Some(match item {
            Item::Line { name, x, y: values, role } if values.iter().any(Option::is_some) => {
                let values: Vec<Option<f64>> = thin(values).into_iter().map(|v| v.map(y)).collect();
                json!({ "kind": "line", "name": name, "role": role, "x": xs(x), "y": values })
            }
            Item::Band { name, x, lower, upper, role } => {
                json!({ "kind": "band", "name": name, "role": role, "x": xs(x), "lower": ys(lower), "upper": ys(upper) })
            }
            Item::Points { name, x, y, role } => {
                json!({ "kind": "points", "name": name, "role": role, "x": xs(x), "y": ys(y) })
            }
            Item::Outline { name, x: corners, y: radii, role } => {
                // A corner that is left out would be another part.
                json!({ "kind": "outline", "name": name, "role": role, "x": corners.iter().copied().map(x).collect::<Vec<_>>(), "y": radii.iter().copied().map(y).collect::<Vec<_>>() })
            }
            _ => return None,
        })
    }

    /// The drawing of the part, and of the other panels the one that is given most room.
    fn telling(figure: &Figure) -> Vec<&Panel> {
        let is_part = |panel: &&Panel| panel.items.iter().any(|item| matches!(item, Item::Outline { .. }));
        let part = figure.panels.iter().find(is_part);
        let others = figure.panels.iter().filter(|panel| !is_part(panel));
        let most = others.fold(None, |best: Option<&Panel>, panel| match best {
            Some(best) if best.height >= panel.height => Some(best),
            _ => Some(panel),
        });
        part.into_iter().chain(most).collect()
    }

    /// A figure as the start page draws it: without numbers at its axes, in thousandths of its width and height.
    pub(super) fn small(figure: &Figure) -> Value {
        let panels = telling(figure);
        let is_polar = figure.frame == Frame::Polar;
        let wide = ends(panels.iter().flat_map(|panel| &panel.items).flat_map(|item| across(item).iter().copied()));
        let x = |v: f64| if is_polar { (v * 10.0).round() / 10.0 } else { place(v, wide, figure.x.scale) };
        let shown = panels.iter().map(|panel| {
            let tall = ends(panel.items.iter().flat_map(up));
            let y = |v: f64| place(v, tall, panel.y.scale);
            let items: Vec<Value> = panel.items.iter().filter_map(|item| drawn(item, &x, &y)).collect();
            json!({ "height": panel.height, "items": items })
        });
        json!({ "frame": figure.frame, "panels": shown.collect::<Vec<_>>() })
    }

    /// Whether two pictures are one: numbers within so many thousandths of the picture.
    pub(super) fn is_same(one: &Value, other: &Value, within: f64) -> bool {
        match (one, other) {
            (Value::Number(a), Value::Number(b)) => (a.as_f64().unwrap() - b.as_f64().unwrap()).abs() <= within,
            (Value::Array(a), Value::Array(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b, within))
            }
            (Value::Object(a), Value::Object(b)) => {
                a.len() == b.len() && a.iter().all(|(name, a)| b.get(name).is_some_and(|b| is_same(a, b, within)))
            }
            (a, b) => a == b,
        }
    }
}
