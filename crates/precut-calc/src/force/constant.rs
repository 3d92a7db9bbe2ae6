//! Forces that do not depend on the cut.

use super::law::{DepthLaw, Law};
use super::{Forces, rules};
use crate::calculator::{Basis, Violations};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Measured forces that do not depend on depth, feed and speed. Equation `deflection/6.3`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Constant {
    /// Passive (radial) force P_y.
    #[schema(minimum = 0, maximum = 1_000_000, example = 194.5,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y")), ("x-group" = json!("cut"))))]
    pub passive_n: f64,
    /// Main (tangential) force P_z; 0 where it is not known.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 424.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z")), ("x-group" = json!("cut"))))]
    pub main_n: f64,
    /// Feed (axial) force P_x; 0 where it is not known.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 165.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_x")), ("x-group" = json!("cut"))))]
    pub feed_n: f64,
    /// Constant part P_0 by rubbing of the worn flank, added to the law wherever something is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rubbing: Option<Forces>,
    /// Factor on the law for a worn edge; 1 for a sharp one. Does not act on `rubbing`.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 10, default = 1.0, example = 1.2,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_w")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub wear_factor: f64,
}

impl Constant {
    pub(super) fn check(&self, pointer: &str, violations: &mut Violations) {
        rules::check_forces(&self.forces(), "bad_constant_force", pointer, violations);
        rules::check_rubbing(self.rubbing.as_ref(), pointer, violations);
        rules::check_wear(self.wear_factor, pointer, violations);
    }

    fn forces(&self) -> Forces {
        Forces { passive_n: self.passive_n, main_n: self.main_n, feed_n: self.feed_n }
    }

    pub(super) fn law(&self) -> DepthLaw {
        DepthLaw::new(Law::constant(self.forces()), self.wear_factor, self.rubbing.unwrap_or_default())
    }
}

pub(super) fn basis() -> Vec<Basis> {
    vec![Basis { equation: "deflection/6.3", source: "forces stated in the job" }]
}
