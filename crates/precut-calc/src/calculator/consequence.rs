//! What comes of a decision that was made with a model.

/// What is judged of a part or a cut, once a decision has been made with one model and others act.
#[derive(Debug, Clone, PartialEq)]
pub struct Consequence {
    /// What is judged, with its unit in the name: `form_error_um`.
    pub name: &'static str,
    /// That unit.
    pub unit: &'static str,
    /// What the job allows; `None` where it says nothing.
    pub allowed: Option<Allowed>,
    /// One value for every model that acts; `None` where nothing can be cut with it.
    pub values: Vec<Option<f64>>,
}

/// What a job allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Allowed {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
}

impl Allowed {
    /// Whether a value is within it.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtMost(most) => value <= most,
            Self::AtLeast(least) => value >= least,
        }
    }
}
