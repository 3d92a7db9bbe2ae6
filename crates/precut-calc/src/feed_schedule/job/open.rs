//! What is not known of the effects of a job, in the results of its models (`certainty/1.3`, `certainty/5.1`).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Failure;
use crate::certainty::OpenEffects;
use crate::certainty::lines::points;
use crate::effects::{JointUncertainty, MachinabilityEffect as Effect};

use crate::feed_schedule::job::acting::ActingModel;
use crate::feed_schedule::job::case::Resolver;
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;

/// Points at which it is tried whether results move straight with what is not known, and how far off they may be, in the scale of the
/// model.
const TRIED: usize = 8;
const STRAIGHT: f64 = 1e-9;

/// What is not known of a schedule.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScheduleUncertainty {
    /// What is not known of the effects of the job, as a diagnosis leaves it; a stored model brings its own. Results scatter by it, too:
    /// limits at a risk are moved in by it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 256, extensions(("x-advanced" = json!(true))))]
    pub effects: Vec<JointUncertainty>,
}

impl ScheduleUncertainty {
    pub(in crate::feed_schedule) fn is_empty(&self) -> bool {
        self.effects.is_empty()
    }

    /// Whether a number may be off.
    pub(in crate::feed_schedule) fn is_open(&self) -> bool {
        self.effects.iter().flat_map(|entry| &entry.moves).any(|unsure| unsure.by.abs() > 0.0)
    }
}

/// The effects of a job as they may be.
#[derive(Debug, Clone, Default)]
pub(in crate::feed_schedule) struct OpenModels {
    open: OpenEffects,
    /// The effects where each independent score of what is not known is 1, and where it is -1.
    off: Vec<[Vec<Effect>; 2]>,
}

/// How far results move with an independent score of what is not known of effects, in the scale of the model.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) enum Move {
    /// By its products with 1, ln V, ln S.
    Straight([f64; 3]),
    /// By half of what is between the models at scores of 1 and -1.
    Bent(Box<[ActingModel; 2]>),
}

impl OpenModels {
    /// Of a checked job.
    pub(in crate::feed_schedule) fn of(job: &Job) -> Result<Self, Failure> {
        let open = OpenEffects::of(&job.effects, &job.uncertainty.effects);
        let at = |score: usize, value: f64| -> Result<Vec<Effect>, Failure> {
            let mut scores = vec![0.0; open.dimensions()];
            scores[score] = value;
            Ok(open.effects(&job.effects, &open.values(&scores))?.unwrap_or_default())
        };
        let off = (0..open.dimensions())
            .map(|score| Ok([at(score, 1.0)?, at(score, -1.0)?]))
            .collect::<Result<_, Failure>>()?;
        Ok(Self { open, off })
    }

    /// Independent scores of what is not known.
    pub(in crate::feed_schedule) fn count(&self) -> usize {
        self.off.len()
    }

    /// How far results of an output move at a depth, with every score that moves them.
    pub(in crate::feed_schedule) fn moves(&self, job: &Job, output: Output, depth_mm: f64) -> Vec<Move> {
        let resolver = Resolver::new(job);
        let model = |effects: &[Effect]| resolver.model(effects, output, depth_mm);
        let of = |[up, down]: &[Vec<Effect>; 2]| Move::of(model(up)?, model(down)?);
        self.off.iter().filter_map(of).collect()
    }

    /// The effects where the scores come to this.
    fn effects<'j>(&self, job: &'j Job, scores: &[f64]) -> Result<Cow<'j, [Effect]>, Failure> {
        let moved = self.open.effects(&job.effects, &self.open.values(scores))?;
        Ok(moved.map_or(Cow::Borrowed(&job.effects[..]), Cow::Owned))
    }
}

impl Move {
    /// `None` where both models are the same.
    fn of(up: ActingModel, down: ActingModel) -> Option<Self> {
        if up == down {
            return None;
        }
        Some(match up.straight_from(&down) {
            Some(by) => Self::Straight(by.map(|part| 0.5 * part)),
            None => Self::Bent(Box::new([up, down])),
        })
    }

    /// At ln V, ln S, and how that changes with both.
    pub(in crate::feed_schedule) fn at(&self, u: f64, x: f64) -> (f64, [f64; 2]) {
        match self {
            Self::Straight(by) => (by[0] + by[1] * u + by[2] * x, [by[1], by[2]]),
            Self::Bent(models) => {
                let [up, down] = [models[0].evaluate(u, x), models[1].evaluate(u, x)];
                (0.5 * (up.0 - down.0), [0.5 * (up.1 - down.1), 0.5 * (up.2 - down.2)])
            }
        }
    }
}

/// Where a result is: of which output, at which ln V, ln S and depth.
#[derive(Debug, Clone, Copy)]
pub(in crate::feed_schedule) struct Given {
    pub output: Output,
    pub at: (f64, f64),
    pub depth_mm: f64,
}

/// Results of a schedule as they move with what is not known of effects.
pub(in crate::feed_schedule) struct MovedResults<'a> {
    open: &'a OpenModels,
    job: &'a Job,
    results: Vec<Given>,
    /// The results as stated, how far each moves with every score to first order, and whether that is all there is to it.
    stated: Vec<f64>,
    by_score: Vec<Vec<f64>>,
    is_straight: bool,
}

impl<'a> MovedResults<'a> {
    pub(in crate::feed_schedule) fn of(
        open: &'a OpenModels,
        job: &'a Job,
        results: Vec<Given>,
    ) -> Result<Self, Failure> {
        let mut moved = Self { open, job, results, stated: Vec::new(), by_score: Vec::new(), is_straight: true };
        moved.stated = moved.values(&job.effects);
        let by_score = |score: usize| -> Vec<f64> {
            let [up, down] = open.off[score].each_ref().map(|effects| moved.values(effects));
            up.iter().zip(down).map(|(up, down)| 0.5 * (up - down)).collect()
        };
        moved.by_score = (0..open.count()).map(by_score).collect();
        for scores in points(TRIED, open.count(), 0) {
            let (really, nearly) = (moved.really(&scores)?, moved.nearly(&scores));
            moved.is_straight &= really.iter().zip(nearly).all(|(by, near)| (by - near).abs() < STRAIGHT);
        }
        Ok(moved)
    }

    /// Whether results move straight with every score.
    pub(in crate::feed_schedule) fn are_straight(&self) -> bool {
        self.is_straight
    }

    /// How far every result moves.
    pub(in crate::feed_schedule) fn at(&self, scores: &[f64]) -> Result<Vec<f64>, Failure> {
        if self.is_straight { Ok(self.nearly(scores)) } else { self.really(scores) }
    }

    /// How far every result moves to first order.
    pub(in crate::feed_schedule) fn nearly(&self, scores: &[f64]) -> Vec<f64> {
        let of = |result: usize| self.by_score.iter().zip(scores).map(|(by, score)| by[result] * score).sum();
        (0..self.results.len()).map(of).collect()
    }

    fn really(&self, scores: &[f64]) -> Result<Vec<f64>, Failure> {
        let values = self.values(&self.open.effects(self.job, scores)?);
        Ok(values.iter().zip(&self.stated).map(|(value, stated)| value - stated).collect())
    }

    /// In the scale of each model.
    fn values(&self, effects: &[Effect]) -> Vec<f64> {
        let resolver = Resolver::new(self.job);
        let value = |of: &Given| {
            let model = resolver.model(effects, of.output, of.depth_mm);
            model.map_or(0.0, |model| model.evaluate(of.at.0, of.at.1).0)
        };
        self.results.iter().map(value).collect()
    }
}
