//! Jobs without an engine, cache or store: for the command line.

use std::sync::Arc;

use precut_calc::calculator::Monitor;

use super::cost::affordable;
use super::exec::guarded;
use super::names::Given;
use super::{Body, Checked, Error, STUDIES, Stored, compute, settings, study};
use crate::registry::{Entry, Registry};

/// What is asked under a name, without an engine.
pub(super) fn entry(registry: &Registry, calculator: &str) -> Result<Arc<Entry>, Error> {
    if calculator == STUDIES {
        return Ok(studies_of(registry));
    }
    registry.entry(calculator).cloned().ok_or_else(|| Error::unknown(registry, calculator))
}

/// Parameter studies over the calculators of a registry, without an engine: nothing is kept.
pub fn studies_of(registry: &Registry) -> Arc<Entry> {
    Arc::new(study::entry(registry, study::MOST_POINTS, Arc::new(study::Alone)))
}

/// Everything but the calculation, with what the names of a job mean.
#[allow(clippy::needless_pass_by_value)] // a body is handed over, here as to an engine
pub fn check_now(registry: &Registry, calculator: &str, body: Body, given: &Given) -> Result<Checked, Error> {
    let entry = entry(registry, calculator)?;
    guarded(|| given.read(registry, &entry, &body)?.into_checked())
}

/// The answer to a job in this thread. It is refused for its cost as by a service with the usual limits.
#[allow(clippy::needless_pass_by_value)]
pub fn solve_now(
    registry: &Registry,
    calculator: &str,
    body: Body,
    given: &Given,
    monitor: &dyn Monitor,
) -> Result<Stored, Error> {
    let entry = entry(registry, calculator)?;
    guarded(|| {
        let ready = given.read(registry, &entry, &body)?;
        affordable(ready.prepared.cost, settings::COST_LIMIT, settings::COST_LIMIT_BYTES)?;
        compute(&ready, monitor)
    })
}
