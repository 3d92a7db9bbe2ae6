//! Path that an edge had cut when a part began, where the parts say which edge it was and no more (`process/3.1`).

use serde::{Deserialize, Serialize};

use crate::calculator::Watched;
use crate::process::part::document::{DocumentOf, PartOf};

/// The edge in use: which, after which part, and the path that it has cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::process) struct Edge {
    which: u32,
    number: u32,
    path_m: f64,
}

/// The part with the path that its edge had cut, where each part since that edge came is known; as it is stated otherwise. `last`
/// is the edge after the part before, and then after this one.
pub(in crate::process) fn completed<M: Watched>(
    document: &DocumentOf<M>,
    part: &PartOf<M>,
    last: &mut Option<Edge>,
) -> PartOf<M> {
    let follows = last.filter(|before| before.number.checked_add(1) == Some(part.number));
    let by_sum = follows.zip(part.edge).and_then(|(before, edge)| match edge {
        _ if edge == before.which => Some(before.path_m),
        // A new one.
        _ if edge > before.which => Some(0.0),
        _ => None,
    });
    let path_m = M::path_m(&part.conditions).or(by_sum);
    let own = PartOf::<M> { conditions: M::at_path_m(&part.conditions, path_m), ..part.clone() };
    let job = document.part_types.get(&part.part_type).map(|of_type| &of_type.job);
    *last = part.edge.zip(path_m).zip(job).map(|((edge, path_m), job)| {
        let path_m = path_m + M::cut_path_m(job, &own.conditions);
        Edge { which: edge, number: part.number, path_m }
    });
    own
}
