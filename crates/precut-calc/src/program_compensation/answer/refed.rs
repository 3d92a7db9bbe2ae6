//! Numbers of the answer: the feeds of the program that is given back.

use crate::feed_schedule::stretches::PriceOfLimit;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::model::refeed::{LimitReached, Refed};

/// The fastest feeds of a program within the limits of `refeed`, as the program that is given back keeps them when it is read and
/// driven as one of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedProgram {
    /// Time of all moves at the feed, as the program is.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub cutting_time_before_min: f64,
    /// The same at the new feeds.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub cutting_time_after_min: f64,
    /// The lines that cut, in the order in which they first do, by columns.
    pub feeds: RefedFeeds,
    /// Lines that cut and keep their feed: it is one per minute at a constant cutting speed, or not one along the line.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub kept_lines: Vec<usize>,
    /// What each number of `refeed` that binds costs, the most costly first.
    pub prices: Vec<RefedPrice>,
    /// The limits with the most that is reached of them at any place of the cut.
    pub limits: Vec<RefedLimit>,
    /// Lines that are as they were, before X is shifted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_compared: usize,
    /// Moves that are no others than before but for their feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub moves_compared: usize,
}

/// Lines that cut and their feeds, all of one length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedFeeds {
    /// Line of the program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
    /// Place of the tool in `tools`, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tool: Vec<Option<u32>>,
    /// Whether it makes the surface that is left.
    pub is_finishing: Vec<bool>,
    /// Where its first move begins, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_start_mm: Vec<f64>,
    /// Where its last move ends.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_end_mm: Vec<f64>,
    /// Length of its moves at the feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub length_mm: Vec<f64>,
    /// Largest depth that it really cuts.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Feed as the program is.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub old_feed_mm_per_rev: Vec<f64>,
    /// Feed of the program that is given back.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub new_feed_mm_per_rev: Vec<f64>,
    /// Limits that one step more of its feed passes, in this line or another; of more than 40 lines those that were passed when
    /// the lines were raised together.
    pub binding: Vec<Vec<String>>,
}

/// A number of `refeed` that binds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedPrice {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// The number, in the unit of its field.
    #[schema(example = 10.0, extensions(("x-unit" = json!("as the field says"))))]
    pub limit: f64,
    /// What one percent looser takes off the time of the lines that cut.
    #[schema(example = 0.34, extensions(("x-unit" = json!("percent"))))]
    pub gain_percent: f64,
}

/// A limit and what is reached of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedLimit {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// The limit, in the unit of its field.
    #[schema(example = 10.0, extensions(("x-unit" = json!("as the field says"))))]
    pub limit: f64,
    /// The most that is reached of it.
    #[schema(example = 9.98, extensions(("x-unit" = json!("as the field says"))))]
    pub reached: f64,
    /// Line in which it is, from 1; null where the limit is one of a tool.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Option<usize>,
}

impl RefedProgram {
    pub(super) fn of(refed: &Refed) -> Self {
        let mut feeds = RefedFeeds::default();
        for one in &refed.stretches {
            feeds.line.push(one.line);
            feeds.tool.push(one.tool);
            feeds.is_finishing.push(one.is_finishing);
            feeds.z_start_mm.push(one.ends_mm[0]);
            feeds.z_end_mm.push(one.ends_mm[1]);
            feeds.length_mm.push(one.length_mm);
            feeds.depth_mm.push(one.depth_mm);
            feeds.old_feed_mm_per_rev.push(one.feeds_mm_per_rev[0]);
            feeds.new_feed_mm_per_rev.push(one.feeds_mm_per_rev[1]);
            feeds.binding.push(one.binding.iter().copied().map(str::to_owned).collect());
        }
        let price = |one: &PriceOfLimit| RefedPrice {
            constraint: one.constraint.clone(),
            limit: one.limit,
            gain_percent: one.gain_percent,
        };
        let limit = |one: &LimitReached| RefedLimit {
            constraint: one.name.to_owned(),
            limit: one.limit,
            reached: one.reached,
            line: one.line,
        };
        Self {
            cutting_time_before_min: refed.time_min[0],
            cutting_time_after_min: refed.time_min[1],
            feeds,
            kept_lines: refed.kept_lines.clone(),
            prices: refed.prices.iter().map(price).collect(),
            limits: refed.limits.iter().map(limit).collect(),
            lines_compared: refed.lines_compared,
            moves_compared: refed.moves_compared,
        }
    }
}
