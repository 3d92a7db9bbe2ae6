//! A schedule that does not exist, in the words of the contract.

use crate::calculator::{Conflict, ConstraintName, ElasticScope, Failure, Finding, Infeasible, Relaxation};

use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::model::infeasible::Infeasibility;
use crate::feed_schedule::model::solve::Unsolved;

/// A failure in the words of the contract.
pub(in crate::feed_schedule) fn worded(unsolved: Unsolved, job: &Job) -> Failure {
    match unsolved {
        Unsolved::Failed(failure) => failure,
        Unsolved::Infeasible(found) => Failure::Conflicting(Box::new(conflict(*found, job))),
    }
}

fn conflict(found: Infeasibility, job: &Job) -> Conflict {
    let first = found.relaxations.first();
    let named = |name: &ConstraintName| format!("{}@{}", name.constraint, name.zone);
    let mut finding = Finding::new("infeasible_schedule", "/limits")
        .with("conflict", found.conflict.iter().map(named).collect::<Vec<_>>())
        .with("relaxations", found.relaxations.len())
        .with("zones", job.zones.len());
    if let Some((name, factor)) = first {
        finding = finding.with("largest", named(name)).with("factor", *factor);
    }
    Conflict {
        finding,
        infeasible: Infeasible {
            elastic_total: found.elastic_total,
            elastic_scope: if found.all_elastic { ElasticScope::All } else { ElasticScope::Requirements },
            relaxations: found
                .relaxations
                .into_iter()
                .map(|(name, factor)| Relaxation { constraint: name.constraint, zone: name.zone, factor })
                .collect(),
            conflict_set: found.conflict,
        },
    }
}
