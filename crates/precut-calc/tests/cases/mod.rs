//! Jobs from use, kept as they came.
#![allow(clippy::unwrap_used, clippy::panic, unreachable_pub, dead_code, reason = "test support")]

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Violations};
use serde_json::Value;

/// A job of a folder beside this file.
pub fn case(path: &str) -> Value {
    // Used by the tests of the whole workspace, too, which are compiled one folder up.
    let package = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).unwrap_or(package);
    let path = root.join("crates/precut-calc").join("tests/cases").join(path);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap()
}

/// What a calculator holds against a job before it computes anything.
pub fn faults<C: Calculator>(job: &Value) -> Vec<Finding> {
    let job: C::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

/// The answer to a job that is accepted.
pub fn answer<C: Calculator>(job: &Value) -> Result<Answer<C::Output>, Failure> {
    let faults = faults::<C>(job);
    assert!(faults.is_empty(), "{faults:?}: {job}");
    let mut job: C::Input = serde_json::from_value(job.clone()).unwrap();
    C::fill(&mut job);
    C::run(&job, &Unwatched)
}

/// Random numbers that are the same everywhere.
pub struct Dice(pub u64);

impl Dice {
    /// The next number of SplitMix64.
    pub fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A whole number, both ends included.
    pub fn whole(&mut self, from: u64, to: u64) -> u64 {
        from + self.roll() % (to - from + 1)
    }

    /// A number between two others.
    #[allow(clippy::cast_precision_loss)]
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * ((self.roll() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Whether a throw comes out so, with that chance in a hundred.
    pub fn percent(&mut self, chance: u64) -> bool {
        self.whole(1, 100) <= chance
    }
}

/// How many random jobs a test tries: a tenth of `all`, or all with `PRECUT_JOBS=all`.
pub fn count(all: u64) -> u64 {
    if std::env::var("PRECUT_JOBS").is_ok_and(|jobs| jobs == "all") { all } else { all / 10 }
}
