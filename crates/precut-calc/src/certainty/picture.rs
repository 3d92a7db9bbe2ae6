//! What the doubt is made of, and what half of a width makes of it: picture and table (`certainty/2`).

use std::borrow::Cow;

use super::{Contribution, JointlyKept};
use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

/// Name of the picture and of its table.
pub(crate) const ID: &str = "doubt";

/// Codes that the picture utters, beside those of the quantities.
pub(crate) const LABEL_CODES: &[&str] =
    &["doubt", "doubt_rank", "doubt_share", "doubt_probability", "doubt_now", "doubt_wanted"];

/// Code of all that is not known of effects.
pub(crate) const MODEL_LABEL: &str = "doubt_model";

/// The picture; `labels` are those of the calculator's quantities, `doubt_` before their names. `None` where
/// nothing is doubted, and where nobody asked what half of a width makes of it.
pub(crate) fn figure(all: &[Contribution], joint: &JointlyKept, labels: &[&'static str]) -> Option<Figure> {
    let label = |one: &Contribution| {
        let code = one.quantity.split(':').next().unwrap_or_default();
        let is_own = |label: &&&str| label.strip_prefix("doubt_") == Some(code);
        labels.iter().find(is_own).copied().unwrap_or("doubt")
    };
    let bars = |of: fn(&Contribution) -> Option<f64>| -> Vec<Item> {
        let bar = |((rank, number), one): ((u32, u8), &Contribution)| {
            let y = of(one)?;
            Some(Item::Bars {
                name: label(one),
                x: vec![f64::from(rank)],
                y: vec![Some(y)],
                role: Role::Series(number),
            })
        };
        (1..).zip(0..).zip(all).filter_map(bar).collect()
    };
    let ends = [1.0, all.len() as f64];
    let line = |name, y: f64, role| Item::Line { name, x: ends.to_vec(), y: vec![Some(y); 2], role };
    let shares = bars(|one| one.share_of_variance);
    let mut halved = bars(|one| one.joint_probability_if_halved);
    if halved.is_empty() {
        return None;
    }
    halved.push(line("doubt_now", joint.probability, Role::Before));
    halved.push(line("doubt_wanted", joint.wanted, Role::Limit));
    let panels = [("doubt_share", shares), ("doubt_probability", halved)].into_iter().filter_map(|(label, items)| {
        (!items.is_empty()).then(|| Panel { y: Axis::linear(label, "1"), height: 1.0, items })
    });
    let panels: Vec<Panel> = panels.collect();
    let x = Axis::linear("doubt_rank", "1");
    Some(Figure { id: ID, title: Message::new("doubt"), frame: Frame::Stacked, x, panels })
}

/// The same as a table.
pub(crate) fn table(all: &[Contribution]) -> Table {
    let shares: Vec<Option<f64>> = all.iter().map(|one| one.share_of_variance).collect();
    let halved: Vec<Option<f64>> = all.iter().map(|one| one.joint_probability_if_halved).collect();
    let ranks: Vec<f64> = (1_u32..).take(all.len()).map(f64::from).collect();
    let words = all.iter().map(|one| Cow::Owned(one.quantity.clone())).collect();
    Table {
        id: ID,
        columns: vec![
            Column::numbers("place", "1", &ranks),
            Column::words("quantity", words),
            Column::optional("share_of_variance", "1", &shares),
            Column::optional("joint_probability_if_halved", "1", &halved),
        ],
    }
}
