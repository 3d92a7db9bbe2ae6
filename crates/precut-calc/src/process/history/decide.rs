//! What a person says of a change (`process/3.5`).

use crate::calculator::Watched;
use crate::process::answer::output::{ChangeVerdict, Decided, Situation, State};
use crate::process::change::null::Source;
use crate::process::change::onsets::What;
use crate::process::change::verdict::judged;
use crate::process::history::memory::Memory;
use crate::process::history::watch::Watch;

/// What a person says of a change.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Decision {
    /// It is one, and joins the model at once.
    Confirm,
    /// It is none: what the parts show belongs to the process, and causes no alarm any more.
    Reject,
    /// It is this one of its causes alone.
    Name(String),
}

impl<M: Watched> Watch<M> {
    /// Takes a decision on a change: what is said then; nothing where there is no such change or it has no such cause.
    pub fn decide(&mut self, id: &str, decision: &Decision) -> Option<State> {
        if !self.memory.decide(id, decision) {
            return None;
        }
        let memory = &self.memory;
        let number = memory.parts.back().map_or(0, |(part, _)| part.number);
        let situation = if memory.pending.is_some() { Situation::Changed } else { Situation::InControl };
        Some(memory.said(number, situation, None))
    }
}

impl Memory {
    fn decide(&mut self, id: &str, decision: &Decision) -> bool {
        let Some(place) = self.changes.iter().position(|change| change.id == id) else { return false };
        let named = match decision {
            Decision::Name(kind) => {
                let cause = self.changes[place].causes.iter().find(|cause| cause.kind == *kind).cloned();
                match cause.as_ref().and_then(|cause| self.place(cause)) {
                    Some((variant, _)) => Some(variant),
                    None => return false,
                }
            }
            Decision::Confirm | Decision::Reject => None,
        };
        if self.pending.as_ref().is_some_and(|pending| pending.id == id) {
            let Some((entries, ..)) = self.weighed() else { return false };
            let judgement = self.with_told(|memory, told| judged(&entries, &memory.catalogue, told)).flatten();
            let Some(mut judgement) = judgement else { return false };
            if let Some(variant) = named {
                judgement.list.retain(|suspect| suspect.what == What::Cause(variant));
                if judgement.list.is_empty() {
                    return false;
                }
            }
            let last = self.parts.back().map_or(0, |(part, _)| part.number);
            self.accept(last, &judgement);
        } else if let Some(variant) = named {
            self.keep_alone(id, variant);
        }
        let change = &mut self.changes[place];
        change.decided = Some(match decision {
            Decision::Confirm => Decided::Confirmed,
            Decision::Reject => Decided::Rejected,
            Decision::Name(kind) => {
                change.verdict = ChangeVerdict::Named;
                change.causes.retain(|cause| cause.kind == *kind);
                change.causes.iter_mut().for_each(|cause| cause.share = 1.0);
                Decided::Named
            }
        });
        true
    }

    /// Of an accepted change one cause stays free.
    fn keep_alone(&mut self, id: &str, variant: usize) {
        let Some(accepted) = self.accepted.iter().find(|accepted| accepted.id == id) else { return };
        let is_gone =
            |own: &crate::process::change::null::Column| accepted.owns(own) && own.source != Source::Cause(variant);
        let gone: Vec<bool> = self.columns.iter().map(is_gone).collect();
        let known: Vec<bool> = gone.iter().take(self.older.eta.len()).copied().collect();
        self.older = self.older.without(&known);
        let mut stays = gone.iter().map(|gone| !gone);
        self.columns.retain(|_| stays.next().unwrap_or(true));
        self.free_again();
    }
}
