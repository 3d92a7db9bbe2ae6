//! How far the search for sets of causes goes.

/// Singles with which pairs are made, and pairs with which triples are, where a part of the rows is held back or every
/// prediction is a simulation; of the whole all singles and more pairs are.
const LEADING_SINGLES: usize = 6;
const LEADING_PAIRS: usize = 6;
const PAIRS_OF_WHOLE: usize = 20;
/// Pairs that are refined beside those that lead from the base, see [`Effort::beside_fits`].
const PAIRS_BESIDE_FITS: usize = 12;
/// Sets that are refined about the model itself.
const LEADERS: usize = 12;
/// Sets that lead only after the others were refined, and are then refined too.
const LATE_LEADERS: usize = 6;

/// Of which sets other optima are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherOptima {
    /// Of none.
    None,
    /// Of the set that leads.
    OfLeader,
    /// Of every single cause, too, and of every set that may yet lead.
    OfAll,
}

/// How far the search goes, and how badly a set may fit that is named.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Causes at the same time, 0 to 3.
    pub most_causes: usize,
    /// Heaviest singles that may have partners, and heaviest pairs that may have a third.
    pub leading: [usize; 2],
    /// Sets that are refined about the model itself.
    pub leaders: usize,
    /// Of the sets of none, one, two and three causes those that are refined in any case: from the base a single cause
    /// of a model that is far from linear looks worse than a set that mimics it.
    pub of_each_size: [usize; 4],
    /// Pairs that are refined since they explain most where one of both is taken about its own fit.
    pub beside_fits: usize,
    /// How often those that lead only after others were refined are refined, too, and how many each time.
    pub rounds: usize,
    /// See `rounds`.
    pub late_leaders: usize,
    /// Whether the model is far from linear in its sizes: then a refinement takes more steps, and what it changes at
    /// the best point of a grid corrects the whole grid.
    pub nonlinear: bool,
    /// Of which sets other optima are looked for.
    pub other_optima: OtherOptima,
    /// Least probability of what a set leaves for it to be named, and of what the base leaves for it to be adequate.
    pub level: f64,
    /// Whether a part of the rows is held back: then of classes, whose test of the base draws thousands, it is not tested.
    pub in_fold: bool,
}

/// Significance level of the tests unless another is asked for.
pub(in crate::diagnosis) const LEVEL: f64 = 0.01;

impl Effort {
    /// The whole search.
    pub fn full(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [usize::MAX, PAIRS_OF_WHOLE],
            leaders: LEADERS,
            of_each_size: [0, usize::MAX, 0, 0],
            beside_fits: 0,
            rounds: 1,
            late_leaders: LATE_LEADERS,
            nonlinear: false,
            other_optima: OtherOptima::OfLeader,
            level: LEVEL,
            in_fold: false,
        }
    }

    /// The same in a fold.
    pub fn fold(most_causes: usize) -> Self {
        Self {
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            of_each_size: [0; 4],
            in_fold: true,
            ..Self::full(most_causes)
        }
    }

    /// Where every prediction is a simulation: fewer sets. Every single cause is looked for wherever it would be if it were
    /// asked for alone: a tool that is pushed off looks worse from the base than many that mimic it, and from one frequency a
    /// second mode is not found that swings at another.
    pub fn dear(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            leaders: 1,
            of_each_size: [0, usize::MAX, 3, 1],
            beside_fits: PAIRS_BESIDE_FITS,
            rounds: 3,
            late_leaders: 2,
            nonlinear: true,
            other_optima: OtherOptima::OfAll,
            level: LEVEL,
            in_fold: false,
        }
    }

    /// Where every prediction is a simulation, or else the whole search.
    pub(in crate::diagnosis) fn of(most_causes: usize, is_dear: bool) -> Self {
        if is_dear { Self::dear(most_causes) } else { Self::full(most_causes) }
    }

    /// The same in a fold.
    pub fn dear_fold(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            leaders: 1,
            of_each_size: [0, 2, 1, 0],
            beside_fits: 0,
            rounds: 1,
            late_leaders: 1,
            nonlinear: true,
            other_optima: OtherOptima::None,
            level: LEVEL,
            in_fold: true,
        }
    }
}
