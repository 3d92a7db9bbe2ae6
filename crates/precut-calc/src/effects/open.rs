//! What is not known of effects: directions in which their numbers are off together.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use utoipa::ToSchema;

use crate::calculator::Failure;

use super::{Cause, Fit, Parameter};

/// Parameters of effects that are unsure together: where the first is off by `by`, so is each of the others. One entry is
/// independent of the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JointUncertainty {
    /// How far each parameter moves, at one standard deviation.
    #[schema(min_items = 1, max_items = 128)]
    pub moves: Vec<ParameterMove>,
}

/// How far a parameter moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterMove {
    /// Number of the effect in its list, from 1.
    #[schema(minimum = 1, maximum = 1000, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
    pub effect: u32,
    /// Field of the effect; of a list the place in it from 0 and the field there: `profile/2/error_um`.
    #[schema(max_length = 64, example = "delta_um_per_n")]
    pub parameter: String,
    /// By how much, in the unit of the field.
    #[schema(minimum = -1e15, maximum = 1e15, example = 0.001, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("1"))))]
    pub by: f64,
}

impl ParameterMove {
    /// The place of its effect in the list; `None` of a number that no list has.
    pub(crate) fn place(&self) -> Option<usize> {
        (self.effect as usize).checked_sub(1)
    }
}

/// An effect with an entry in a catalogue.
pub(crate) trait Catalogued {
    /// Its entry.
    fn entry(&self) -> &'static Cause;

    /// A parameter of it; `None` of what is no number of its entry, as the places of a profile.
    fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.entry().parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Whether a parameter is read off the job, and so may not be off by itself.
    fn is_of_job(&self, name: &str) -> bool {
        self.parameter(name).is_some_and(|parameter| matches!(parameter.fit, Fit::OfJob))
    }
}

impl Catalogued for super::DeflectionEffect {
    fn entry(&self) -> &'static Cause {
        self.cause()
    }
}

impl Catalogued for super::FixtureEffect {
    fn entry(&self) -> &'static Cause {
        self.cause()
    }
}

impl Catalogued for super::MachinabilityEffect {
    fn entry(&self) -> &'static Cause {
        self.cause()
    }
}

impl Catalogued for super::MillingEffect {
    fn entry(&self) -> &'static Cause {
        self.cause()
    }
}

impl Catalogued for super::RingEffect {
    fn entry(&self) -> &'static Cause {
        self.cause()
    }
}

/// An effect with some of its numbers changed: the path of each, and what becomes of it. What it does not have stays away.
pub(crate) fn with_changed<'p, E, F>(effect: &E, changes: impl Iterator<Item = (&'p str, F)>) -> Result<E, Failure>
where
    E: Serialize + DeserializeOwned,
    F: FnOnce(f64) -> f64,
{
    let unchanged = |error: serde_json::Error| Failure::Internal(format!("an effect that is changed: {error}"));
    let mut fields = serde_json::to_value(effect).map_err(unchanged)?;
    for (path, becomes) in changes {
        if let Some(field) = fields.pointer_mut(&format!("/{path}")) {
            *field = becomes(field.as_f64().unwrap_or(0.0)).into();
        }
    }
    serde_json::from_value(fields).map_err(unchanged)
}

/// Whether an effect has a number of that name.
pub(crate) fn has_parameter(effect: &impl Serialize, parameter: &str) -> bool {
    serde_json::to_value(effect)
        .is_ok_and(|fields| fields.pointer(&format!("/{parameter}")).is_some_and(serde_json::Value::is_f64))
}
