//! Memory of what is being read: bodies, and what is made of them, of all requests together.

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;

/// Bodies up to this size are not held against the budget: as many as there may be requests take little.
const UNCHARGED: usize = 32 << 10;
/// What a body and what is made of it take at once, by its size: a text in it stands there a second time, and a third where
/// it has escapes. Charged as the body arrives: what is refused later has been taken already.
const TIMES: usize = 3;

/// What a body of so many bytes is charged.
pub(crate) fn charge_of(bytes: usize) -> usize {
    if bytes <= UNCHARGED { 0 } else { TIMES * bytes }
}

/// What of that is for what is made of it.
pub(crate) fn paid_beside(bytes: usize) -> usize {
    charge_of(bytes).saturating_sub(bytes)
}

/// What is charged is taken from the budget in pieces of at least so many bytes.
const PIECE: usize = 64 << 10;

/// So many bytes for all. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Budget {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    most: usize,
    used: AtomicUsize,
}

/// The budget is spent: what is asked for may be had when others are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spent;

/// A part of the budget, given back with its end.
#[derive(Debug)]
pub(crate) struct Held {
    budget: Budget,
    bytes: usize,
}

impl Budget {
    pub(crate) fn new(most: usize) -> Self {
        Self { shared: Arc::new(Shared { most, used: AtomicUsize::new(0) }) }
    }

    /// Nothing of it yet.
    pub(crate) fn hold(&self) -> Held {
        Held { budget: self.clone(), bytes: 0 }
    }

    /// What is in use, bytes.
    pub(crate) fn used(&self) -> usize {
        self.shared.used.load(Ordering::Relaxed)
    }
}

impl Held {
    /// Takes so many more bytes, all or none.
    pub(crate) fn grow(&mut self, bytes: usize) -> Result<(), Spent> {
        let Shared { most, used } = &*self.budget.shared;
        let more = |used: usize| used.checked_add(bytes).filter(|sum| sum <= most);
        used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).map_err(|_| Spent)?;
        self.bytes += bytes;
        Ok(())
    }

    /// How many.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    /// The bytes that it was taken for: it is given back when the last of them are forgotten.
    pub(crate) fn with(self, bytes: Bytes) -> Bytes {
        struct Charged(Bytes, #[allow(dead_code)] Held); // held, never looked at
        impl AsRef<[u8]> for Charged {
            fn as_ref(&self) -> &[u8] {
                &self.0
            }
        }
        if self.bytes == 0 { bytes } else { Bytes::from_owner(Charged(bytes, self)) }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.budget.shared.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// What one reader takes for what it makes of a body. Without a budget there is no limit.
#[derive(Debug, Default)]
pub(crate) struct Room {
    held: Option<RefCell<Held>>,
    /// What was charged with the body already.
    paid: Cell<usize>,
    pending: Cell<usize>,
    spent: Cell<bool>,
}

impl Room {
    /// For a body that has `paid` so many bytes for it.
    pub(crate) fn of(budget: &Budget, paid: usize) -> Self {
        Self { held: Some(RefCell::new(budget.hold())), paid: Cell::new(paid), ..Self::default() }
    }

    /// Takes so many bytes; whether there were as many. Once there were not, there are none any more.
    pub(crate) fn take(&self, bytes: usize) -> bool {
        let of_paid = bytes.min(self.paid.get());
        self.paid.set(self.paid.get() - of_paid);
        let pending = self.pending.get() + bytes - of_paid;
        self.pending.set(pending);
        if pending >= PIECE
            && let Some(held) = &self.held
        {
            self.pending.set(0);
            if held.borrow_mut().grow(pending).is_err() {
                self.spent.set(true);
            }
        }
        !self.spent.get()
    }

    /// Whether something did not fit.
    pub(crate) fn is_spent(&self) -> bool {
        self.spent.get()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_given_back_with_its_end() {
        let budget = Budget::new(100);
        let mut held = budget.hold();
        held.grow(60).unwrap();
        let mut other = budget.hold();
        assert_eq!(other.grow(41), Err(Spent));
        other.grow(40).unwrap();
        assert_eq!((budget.used(), other.grow(usize::MAX)), (100, Err(Spent)));
        let bytes = held.with(Bytes::from_static(b"body"));
        drop(other);
        let copy = bytes.clone();
        drop(bytes);
        assert_eq!((budget.used(), &copy[..]), (60, &b"body"[..]));
        drop(copy);
        assert_eq!(budget.used(), 0);
    }

    #[test]
    fn a_large_body_pays_for_what_is_made_of_it() {
        assert_eq!([charge_of(UNCHARGED), paid_beside(UNCHARGED)], [0, 0]);
        assert_eq!([charge_of(1 << 20), paid_beside(1 << 20)], [3 << 20, 2 << 20]);
    }

    #[test]
    fn a_reader_takes_no_more_than_there_is() {
        let budget = Budget::new(3 * PIECE);
        let room = Room::of(&budget, 0);
        let taken = 100 * (0..PIECE).take_while(|_| room.take(100)).count();
        assert!((2 * PIECE..=4 * PIECE).contains(&taken), "{taken}");
        assert!(room.is_spent() && !room.take(0));
        drop(room);
        assert_eq!(budget.used(), 0);
        let room = Room::of(&budget, 5 * PIECE);
        assert!(room.take(4 * PIECE) && budget.used() == 0);
        assert!(room.take(3 * PIECE) && budget.used() == 2 * PIECE);
        assert!(Room::default().take(usize::MAX / 2));
    }
}
