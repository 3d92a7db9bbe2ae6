//! Why limits cannot all hold: a smallest set that conflicts, and the least relaxation that lets them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Finding;

/// Limits that cannot all hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Conflict {
    /// What is to be said of it.
    pub finding: Finding,
    /// In numbers.
    pub infeasible: Infeasible,
}

/// Limits that cannot all hold, and what would make them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Infeasible {
    /// Least sum of relaxations, each in logarithms of its factor. It is unique, its split over the limits may not be.
    #[schema(minimum = 0.0, example = 0.423)]
    pub elastic_total: f64,
    /// Which limits were allowed to give.
    pub elastic_scope: ElasticScope,
    /// Limits that give in the least relaxation, the largest first.
    pub relaxations: Vec<Relaxation>,
    /// Limits that cannot hold together; without any one of them the others can. There may be other such sets.
    pub conflict_set: Vec<ConstraintName>,
}

/// Which limits a least relaxation may loosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ElasticScope {
    /// What the job asks of the part; machine and data ranges stay.
    Requirements,
    /// All: relaxing the requirements alone is not enough.
    All,
}

/// A limit that gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Relaxation {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// Where it holds.
    #[schema(example = "z5")]
    pub zone: String,
    /// What the limit is to be multiplied by.
    #[schema(minimum = 0.0, example = 1.53)]
    pub factor: f64,
}

/// A limit by name and place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ConstraintName {
    /// The limit: `deflection`, `roughness`, `speed_max` ..., or the name of a custom limit or coupling.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// The zone; `part` for sums over the part, a surface's name for sums over one, zones joined by `|` for limits between them.
    #[schema(example = "z5")]
    pub zone: String,
}
