//! Two stored models beside each other: which causes both have, how far their sizes lie apart.

use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

use super::StoredModel;
use super::models::ModelError;
use precut_calc::calculator::Finding;

/// One model against another.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ModelComparison {
    /// Whose jobs both extend.
    #[schema(example = "deflection-compensation")]
    pub calculator: String,
    /// The model asked for.
    pub model: ModelHead,
    /// The model that it is compared with.
    pub other: ModelHead,
    /// Whether both say the same: equal hashes.
    pub identical: bool,
    /// Effects of either, those of the model first.
    pub effects: Vec<EffectComparison>,
}

/// Which revision of which model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ModelHead {
    /// Its name.
    #[schema(example = "lathe-7-winter")]
    pub name: String,
    /// Its revision.
    #[schema(minimum = 1, example = 3)]
    pub revision: u32,
    /// Hash of what it says.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub sha256: String,
    /// What was diagnosed; null where that is not known.
    #[schema(example = "diameter_deviation_um")]
    pub quantity: Option<String>,
}

/// Which of two models has an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// Both.
    Both,
    /// The model asked for.
    Model,
    /// The one that it is compared with.
    Other,
}

/// An effect of either model.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct EffectComparison {
    /// Its kind.
    #[schema(example = "headstock_compliance")]
    pub kind: String,
    /// What tells it from others of its kind: batch, factor and level, the order of a wave; empty where there is one.
    #[schema(value_type = Object)]
    pub of: Map<String, Value>,
    /// Who has it.
    pub has: Sides,
    /// Its parameters.
    pub parameters: Vec<ParameterComparison>,
}

/// A parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ParameterComparison {
    /// Its name with its unit.
    #[schema(example = "delta_um_per_n")]
    pub name: String,
    /// Value in the model; null where it has none.
    pub model: Option<f64>,
    /// Value in the other; null where it has none.
    pub other: Option<f64>,
    /// Other minus model; null where one has none.
    pub difference: Option<f64>,
    /// 95 % interval in the model, as its diagnosis gave it; null where it gave none.
    pub model_interval_95: Option<[f64; 2]>,
    /// The same of the other.
    pub other_interval_95: Option<[f64; 2]>,
    /// Whether the intervals do not meet: then the machine, or what was measured, has changed. Null where one is absent.
    pub apart: Option<bool>,
}

/// Compares two models of one calculator.
pub(super) fn compare(model: &StoredModel, other: &StoredModel) -> Result<ModelComparison, ModelError> {
    let calculator = &model.content.calculator;
    if *calculator != other.content.calculator {
        let finding = Finding::new("models_of_two_calculators", "")
            .with("calculator", calculator.clone())
            .with("of", other.content.calculator.clone());
        return Err(ModelError::Invalid(vec![finding]));
    }
    let mut left: Vec<&Value> = other.content.effects.iter().collect();
    let mut effects: Vec<EffectComparison> = model
        .content
        .effects
        .iter()
        .map(|effect| {
            let twin = left.iter().position(|candidate| identity(candidate) == identity(effect));
            effect_of([Some((model, effect)), twin.map(|index| (other, left.remove(index)))])
        })
        .collect();
    effects.extend(left.into_iter().map(|effect| effect_of([None, Some((other, effect))])));
    Ok(ModelComparison {
        calculator: calculator.clone(),
        model: head(model),
        other: head(other),
        identical: model.sha256 == other.sha256,
        effects,
    })
}

fn head(model: &StoredModel) -> ModelHead {
    ModelHead {
        name: model.name.clone(),
        revision: model.revision,
        sha256: model.sha256.clone(),
        quantity: model.content.provenance["quantity"].as_str().map(str::to_owned),
    }
}

/// What tells an effect from others: its kind and other words, which wave it is, and over what a profile goes.
pub(super) fn identity(effect: &Value) -> Map<String, Value> {
    const WAVES: [&str; 3] = ["order", "ratio", "waves_per_revolution"];
    let fields = effect.as_object().into_iter().flatten();
    let apart = fields.filter(|(name, value)| value.is_string() || WAVES.contains(&name.as_str()));
    let mut apart: Map<String, Value> = apart.map(|(name, value)| (name.clone(), value.clone())).collect();
    if let Some(point) = effect.pointer("/profile/0").and_then(Value::as_object) {
        let over: Vec<&str> = point.keys().map(String::as_str).collect();
        apart.insert("profile".to_owned(), over.join(", ").into());
    }
    apart
}

type Side<'a> = Option<(&'a StoredModel, &'a Value)>;

fn effect_of(sides: [Side<'_>; 2]) -> EffectComparison {
    let first = sides.iter().flatten().next().map(|(_, effect)| *effect);
    let mut of = first.map(identity).unwrap_or_default();
    let kind = of.remove("kind").and_then(|kind| kind.as_str().map(str::to_owned)).unwrap_or_default();
    let mut names: Vec<&String> = Vec::new();
    for (_, effect) in sides.iter().flatten() {
        let fields = effect.as_object().into_iter().flatten();
        for (name, _) in fields.filter(|(_, value)| value.is_number()) {
            if !names.contains(&name) && !of.contains_key(name) {
                names.push(name);
            }
        }
    }
    let has = match sides {
        [Some(_), Some(_)] => Sides::Both,
        [Some(_), None] => Sides::Model,
        [None, _] => Sides::Other,
    };
    let parameters = names.into_iter().map(|name| parameter_of(name, sides)).collect();
    EffectComparison { kind, of, has, parameters }
}

fn parameter_of(name: &str, sides: [Side<'_>; 2]) -> ParameterComparison {
    let [model, other] = sides.map(|side| side.and_then(|(_, effect)| effect[name].as_f64()));
    let [mine, its] = sides.map(|side| side.and_then(|(model, effect)| interval(model, effect, name)));
    ParameterComparison {
        name: name.to_owned(),
        model,
        other,
        difference: model.zip(other).map(|(model, other)| other - model),
        model_interval_95: mine,
        other_interval_95: its,
        apart: mine.zip(its).map(|(a, b)| a[1] < b[0] || b[1] < a[0]),
    }
}

/// Of a parameter, between what a diagnosis says of it and its effect.
const ROUND_OFF: f64 = 1e-9;

/// As the diagnosis gave it; not that of an effect that was changed since.
fn interval(model: &StoredModel, effect: &Value, name: &str) -> Option<[f64; 2]> {
    let causes = model.content.provenance["causes"].as_array()?;
    // What a cause is called is for people; its kind and the values of its parameters are those of its effect.
    let is_its = |parameter: &Value| {
        let value = parameter["name"].as_str().and_then(|name| effect[name].as_f64());
        value
            .zip(parameter["value"].as_f64())
            .is_some_and(|(its, found)| (its - found).abs() <= ROUND_OFF * found.abs())
    };
    let same = |cause: &&Value| {
        let parameters = cause["parameters"].as_array().map_or(&[][..], Vec::as_slice);
        cause["kind"] == effect["kind"] && parameters.iter().all(is_its)
    };
    let parameters = causes.iter().find(same)?["parameters"].as_array()?;
    let ends = &parameters.iter().find(|parameter| parameter["name"] == name)?["interval_95"];
    Some([ends[0].as_f64()?, ends[1].as_f64()?])
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::engine::ModelContent;
    use serde_json::json;

    fn model(effects: Value, causes: &Value) -> StoredModel {
        let provenance = json!({ "quantity": "roughness_um", "causes": causes });
        let effects: Vec<Value> = serde_json::from_value(effects).unwrap();
        let content = ModelContent { calculator: "feed-schedule".to_owned(), effects, provenance };
        let sha256 = crate::engine::model::sha256(&content.canonical());
        StoredModel { name: "m".to_owned(), revision: 1, sha256, created_ms: 0, content }
    }

    fn wear(rate: f64, low: f64, high: f64) -> (Value, Value) {
        let cause = json!({ "kind": "wear_in", "label": "",
            "parameters": [{ "name": "rate_mm_per_min", "value": rate, "interval_95": [low, high] }] });
        (json!({ "kind": "wear_in", "rate_mm_per_min": rate }), cause)
    }

    #[test]
    fn equal_causes_stand_beside_each_other_and_their_intervals_say_whether_they_part() {
        let shift = |batch: &str, by: f64| json!({ "kind": "batch_shift", "batch": batch, "delta_ln": by });
        let (a_wear, a_cause) = wear(0.010, 0.008, 0.012);
        let (b_wear, b_cause) = wear(0.015, 0.013, 0.017);
        let a = model(json!([a_wear, shift("A", 0.1)]), &json!([a_cause]));
        let b = model(json!([shift("B", 0.2), b_wear]), &json!([b_cause]));
        let found = compare(&a, &b).unwrap();
        assert!(!found.identical);
        let sides: Vec<(&str, Sides)> = found.effects.iter().map(|e| (e.kind.as_str(), e.has)).collect();
        let expected = [("wear_in", Sides::Both), ("batch_shift", Sides::Model), ("batch_shift", Sides::Other)];
        assert_eq!(sides, expected);
        let rate = &found.effects[0].parameters[0];
        assert_eq!((rate.model, rate.other, rate.apart), (Some(0.010), Some(0.015), Some(true)));
        assert!((rate.difference.unwrap() - 0.005).abs() < 1e-15);
        assert_eq!(found.effects[2].of["batch"], "B");
        assert_eq!(found.effects[2].parameters[0].apart, None);
    }

    #[test]
    fn batches_and_waves_are_compared_with_their_own_and_what_was_changed_has_no_interval() {
        let shift = |batch: &str, by: f64| json!({ "kind": "batch_shift", "batch": batch, "delta_ln": by });
        let found = |batch: &str, by: f64| {
            json!({ "kind": "batch_shift", "label": batch,
                "parameters": [{ "name": "delta_ln", "value": by, "interval_95": [by - 0.01, by + 0.01] }] })
        };
        let wave = |order: u32, by: f64| json!({ "kind": "initial_harmonic", "order": order, "amplitude_mm": by });
        let a = model(
            json!([shift("10", 0.3), shift("1", 0.1), wave(3, 0.01)]),
            &json!([found("10", 0.3), found("1", 0.1)]),
        );
        let b = model(json!([shift("1", 0.2), wave(5, 0.02), wave(3, 0.03)]), &json!([found("1", 0.25)]));
        let comparison = compare(&a, &b).unwrap();
        let of = |index: usize| &comparison.effects[index];
        assert_eq!(
            (of(0).has, of(1).has, of(2).has, of(3).has),
            (Sides::Model, Sides::Both, Sides::Both, Sides::Other)
        );
        assert_eq!(of(1).parameters[0].model_interval_95, Some([0.1 - 0.01, 0.1 + 0.01]));
        assert_eq!(of(1).parameters[0].other_interval_95, None, "0.2 is not what was found");
        assert_eq!((&of(2).of["order"], &of(3).of["order"]), (&json!(3), &json!(5)));
        assert_eq!((of(2).parameters.len(), of(2).parameters[0].other), (1, Some(0.03)));
    }

    #[test]
    fn a_model_is_identical_to_itself() {
        let (effect, cause) = wear(0.010, 0.008, 0.012);
        let a = model(json!([effect]), &json!([cause]));
        let found = compare(&a, &a.clone()).unwrap();
        assert!(found.identical && found.effects[0].parameters[0].apart == Some(false));
        assert_eq!(found.effects[0].parameters[0].difference, Some(0.0));
    }

    #[test]
    fn models_of_two_calculators_are_not_compared() {
        let (effect, cause) = wear(0.010, 0.008, 0.012);
        let a = model(json!([effect]), &json!([cause]));
        let mut b = a.clone();
        b.content.calculator = "ring-roundness".to_owned();
        let Err(ModelError::Invalid(findings)) = compare(&a, &b) else { unreachable!("they are compared") };
        assert_eq!(findings[0].code, "models_of_two_calculators");
    }
}
