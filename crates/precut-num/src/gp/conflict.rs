//! A smallest set of limits that cannot hold together (`feed/6.5`).

use std::ops::Range;

use super::feasibility::{TOLERANCE, Verdict, feasibility, nearest};
use super::{Affines, Failed, Objective, Program};

/// Limits that no point satisfies together, while without any one of them one does; empty where all hold together. Rows go
/// by their number, sums by theirs behind the rows'.
///
/// Limits are left out, many at once first, while the rest still conflicts.
///
/// # Errors
/// Where a test of feasibility came to nothing.
pub fn conflict(program: &Program, limits: &[usize]) -> Result<Vec<usize>, Failed> {
    let mut search = Search { program, members: limits.to_vec(), near: Near::NotSought };
    let Verdict::Infeasible { rows, sums, .. } = search.test(limits)? else { return Ok(Vec::new()) };
    let kept = supported(limits, &rows, &sums);
    if search.test(&kept)? != Verdict::Feasible {
        search.members = kept;
    }
    let mut size = (search.members.len() / 4).max(1);
    loop {
        search.thin_out(size)?;
        if size == 1 {
            return Ok(search.members);
        }
        size = (size / 4).max(1);
    }
}

struct Search<'a> {
    program: &'a Program,
    /// They conflict.
    members: Vec<usize>,
    near: Near,
}

/// The point that keeps the members' rows and comes nearest to their sums.
enum Near {
    NotSought,
    NotFound,
    Found(Vec<f64>),
}

/// Most members that are left out about one point, and most variables that change for them.
const AROUND: (usize, usize) = (16, 64);

impl Search<'_> {
    fn test(&self, members: &[usize]) -> Result<Verdict, Failed> {
        let (rows, sums) = self.split(members);
        feasibility(self.program, &rows, &sums)
    }

    fn split(&self, members: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let count = self.program.rows.len();
        let (rows, sums): (Vec<usize>, Vec<usize>) = members.iter().copied().partition(|&k| k < count);
        (rows, sums.into_iter().map(|k| k - count).collect())
    }

    /// Leaves out so many members at once wherever the others still conflict.
    fn thin_out(&mut self, size: usize) -> Result<(), Failed> {
        let mut k = 0;
        while k < self.members.len() {
            let end = (k + size).min(self.members.len());
            if self.is_met_around(k..end) {
                k = end;
                continue;
            }
            let without: Vec<usize> = [&self.members[..k], &self.members[end..]].concat();
            match self.test(&without)? {
                Verdict::Feasible => k = end,
                Verdict::Infeasible { rows, sums, .. } => {
                    // The new certificate may leave out others behind these as well; those before are needed.
                    let kept = supported(&without[k..], &rows, &sums);
                    let still = [&without[..k], &kept].concat();
                    let is_less = still.len() < without.len() && self.test(&still)? != Verdict::Feasible;
                    self.members = if is_less { still } else { without };
                    self.near = Near::NotSought;
                }
            }
        }
        Ok(())
    }

    /// Whether a point was found that keeps all members but these: the nearest to all of them, changed only where those
    /// stand. Of many zones that is far cheaper than to look everywhere; where it finds nothing there may still be a point.
    fn is_met_around(&mut self, out: Range<usize>) -> bool {
        if out.len() > AROUND.0 {
            return false;
        }
        if matches!(self.near, Near::NotSought) {
            let (rows, sums) = self.split(&self.members);
            self.near = nearest(self.program, &rows, &sums).map_or(Near::NotFound, Near::Found);
        }
        let Near::Found(near) = &self.near else { return false };
        let (rows, sums) = self.split(&[&self.members[..out.start], &self.members[out.end..]].concat());
        let (gone, _) = self.split(&self.members[out]);
        let is_free = self.around(&gone, &rows);
        let Some(window) = self.window(&rows, &sums, &is_free, near) else { return false };
        if window.rows.is_empty() && window.sums.is_empty() {
            return true;
        }
        let all = |count: usize| (0..count).collect::<Vec<usize>>();
        let found = feasibility(&window, &all(window.rows.len()), &all(window.sums.len()));
        matches!(found, Ok(Verdict::Feasible))
    }

    /// Variables of the rows that are gone, and those of the chain that further rows tie to them.
    fn around(&self, gone: &[usize], rows: &[usize]) -> Vec<bool> {
        let program = self.program;
        let mut is_free = vec![false; program.variables()];
        gone.iter().flat_map(|&row| program.rows.entries(row)).for_each(|(i, _)| is_free[i] = true);
        let mut room = AROUND.1;
        loop {
            let mut is_done = true;
            for &row in rows {
                let local = || program.rows.entries(row).map(|(i, _)| i).filter(|&i| i < program.local);
                let tied = local().filter(|&i| !is_free[i]).count();
                if tied > 0 && tied <= room && local().any(|i| is_free[i]) {
                    room -= tied;
                    local().for_each(|i| is_free[i] = true);
                    is_done = false;
                }
            }
            if is_done {
                return is_free;
            }
        }
    }

    /// The limits with all variables but the free ones fixed at a point; `None` where one that no free variable enters is
    /// broken there.
    fn window(&self, rows: &[usize], sums: &[usize], is_free: &[bool], near: &[f64]) -> Option<Program> {
        let program = self.program;
        let mut of_rows = Affines::new();
        for &row in rows {
            let (entries, constant) = fixed(&program.rows, row, is_free, near);
            if !entries.is_empty() {
                of_rows.push(&entries, constant);
            } else if constant > TOLERANCE {
                return None;
            }
        }
        let mut of_sums = Vec::new();
        for terms in sums.iter().map(|&sum| &program.sums[sum]) {
            let mut open = Affines::new();
            let mut closed = 0.0;
            for term in 0..terms.len() {
                let (entries, constant) = fixed(terms, term, is_free, near);
                if entries.is_empty() {
                    closed += constant.exp();
                } else {
                    open.push(&entries, constant);
                }
            }
            if closed.ln() > TOLERANCE {
                return None;
            }
            if !open.is_empty() {
                if closed > 0.0 {
                    open.push(&[], closed.ln());
                }
                of_sums.push(open);
            }
        }
        Some(Program {
            local: program.local,
            common: program.common,
            objective: Objective::Linear(Affines::new()),
            rows: of_rows,
            sums: of_sums,
            start: program.start.clone(),
        })
    }
}

/// A form with all variables but the free ones at a point: what is left of it, and its constant.
fn fixed(forms: &Affines, row: usize, is_free: &[bool], near: &[f64]) -> (Vec<(usize, f64)>, f64) {
    let mut constant = forms.constant(row);
    let mut entries = Vec::new();
    for (i, a) in forms.entries(row) {
        if is_free[i] {
            entries.push((i, a));
        } else {
            constant += a * near[i];
        }
    }
    (entries, constant)
}

/// Members whose weight in the certificate is above rounding.
fn supported(members: &[usize], rows: &[f64], sums: &[f64]) -> Vec<usize> {
    let weight = |k: usize| if k < rows.len() { rows[k] } else { sums[k - rows.len()] };
    let most = rows.iter().chain(sums).copied().fold(0.0, f64::max);
    members.iter().copied().filter(|&k| weight(k) > 1e-6 * most).collect()
}
