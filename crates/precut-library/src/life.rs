//! Tool life of a row of a material as a model of feed schedules: `library/5`.

use serde_json::{Map, Value, json};

/// A row of the handbook is left within this share of its feed bounds: neighbouring rows join there with a step.
pub const NEAR_BOUND: f64 = 0.1;
/// Beyond this share of its stated feed and depth a row of Taylor's form says nothing certain.
pub const TAYLOR_RANGE: f64 = 0.25;

/// The row as `{form, constant, speed_exponent, feed_exponent, depth_exponent, range, ...}`, ln T over ln V, ln s, ln t.
///
/// Handbook V = C_v/(T^m t^x s^y): ln T = (ln C_v - ln V - x ln t - y ln s)/m, with the row's bounds of the feed. Taylor
/// V T^n = C: ln T = (ln C - ln V)/n, near the feed and depth of its trials alone: how the life goes with them is not
/// known, so the range is the stated point by +-25 %.
pub fn model(row: &Value, source: &str) -> Option<Value> {
    let number = |name: &str| row.get(name).and_then(Value::as_f64);
    let exponent = number("life_exponent").filter(|exponent| *exponent > 0.0)?;
    let (coefficient, feed, depth, range) = match row.get("form")?.as_str()? {
        "handbook" => {
            let range = [
                ("least_feed_mm_per_rev", number("feed_above_mm_per_rev")),
                ("largest_feed_mm_per_rev", number("feed_up_to_mm_per_rev")),
            ];
            (number("coefficient")?, number("feed_exponent")?, number("depth_exponent")?, range.to_vec())
        }
        "taylor" => {
            let about = |name: &str, share: f64| number(name).map(|value| value * share);
            let ends = |name: &'static str| [about(name, 1.0 - TAYLOR_RANGE), about(name, 1.0 + TAYLOR_RANGE)];
            let [feed, depth] = [ends("at_feed_mm_per_rev"), ends("at_depth_mm")];
            let range = [
                ("least_feed_mm_per_rev", feed[0]),
                ("largest_feed_mm_per_rev", feed[1]),
                ("least_depth_mm", depth[0]),
                ("largest_depth_mm", depth[1]),
            ];
            (number("speed_at_one_minute_m_per_min")?, 0.0, 0.0, range.to_vec())
        }
        _ => return None,
    };
    let range: Map<String, Value> =
        range.into_iter().filter_map(|(name, end)| Some((name.to_owned(), json!(end?)))).collect();
    let mut model = json!({
        "form": "log_log", "constant": coefficient.ln() / exponent, "speed_exponent": -1.0 / exponent,
        "feed_exponent": 0.0 - feed / exponent, "depth_exponent": 0.0 - depth / exponent, "source": source,
    });
    if !range.is_empty() {
        model["range"] = Value::Object(range);
    }
    for (to, from) in [("residual_scatter", "scatter_of_log_life"), ("trials", "trials"), ("certainty", "certainty")] {
        if let Some(value) = row.get(from) {
            model[to] = value.clone();
        }
    }
    Some(model)
}
