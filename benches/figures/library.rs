//! What names in jobs cost.

use precut_library::Lookup;
use precut_library::iso::Insert;
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

/// A shaft in a lathe, with names for all that is not its own.
fn named() -> Value {
    json!({
        "machine": "lathe_engine_medium", "tool": { "name": "bar_a25_pclnr12", "overhang_mm": 100 }, "material": "4140",
        "shaft": { "segments": [{ "length_mm": 400, "diameter_mm": 60, "stock_diameter_mm": 63 }] },
        "supports": [{ "kind": "chuck", "z_mm": 0 }, { "kind": "centre", "z_mm": 400 }],
        "force": { "kind": "kienzle", "normal_force": "judged" },
        "cut": { "feed_mm_per_rev": 0.25, "speed_m_per_min": 180 },
    })
}

/// Three names looked up among the engine's records and written into a job.
pub(crate) fn resolve() -> Result<Measured, String> {
    const CALCULATOR: &str = "deflection-compensation";
    let job = named();
    let resolved = || {
        let mut job = job.clone();
        let asked = precut_library::asked(CALCULATOR, &job);
        let found: Vec<_> = asked.iter().map(|asked| (asked.clone(), Lookup::built_in(asked))).collect();
        precut_library::resolve(CALCULATOR, &mut job, &found)
    };
    let first = resolved();
    if !first.faults.is_empty() || first.origins.is_empty() {
        return Err(format!("{:?}", first.faults));
    }
    cpu_time(resolved)
}

/// The designation of an insert, read.
pub(crate) fn code() -> Result<Measured, String> {
    let read = || "DNMG150608".parse::<Insert>();
    read().map_err(|faults| format!("{faults:?}"))?;
    cpu_time(read)
}
