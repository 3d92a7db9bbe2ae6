//! Compliance, coupling and sag at many stations.

use super::contact::{Contacts, REGULARISATION};
use super::form::{Raised, Span, sample};
use super::matrix::{Symmetric, VANISHING};
use super::plane::Plane;
use super::station::{Rows, Works};
use super::turning::Turning;
use super::{Beam, Steady};

/// What a profile is asked for besides the radial compliance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wanted {
    /// Compliance in the tangential plane.
    pub tangential: bool,
    /// Coupling to the couple of the axial force.
    pub couple: bool,
    /// Sag in both planes.
    pub weight: bool,
}

/// Values at the stations; what was not asked for is empty.
#[derive(Debug, Clone, Default)]
pub struct Profile {
    /// `W`: radial displacement of the work at the tool per unit radial force there, mm/N; one-sided rests open.
    pub radial_mm_per_n: Vec<f64>,
    /// `G_vt`: the same per unit couple there, mm/(N mm) = 1/N.
    pub couple_per_n: Vec<f64>,
    /// `W` in the tangential plane, mm/N; one-sided rests hold both ways.
    pub tangential_mm_per_n: Vec<f64>,
    /// Radial displacement, mm, by the full weight acting in the positive radial direction; one-sided rests open.
    pub sag_radial_mm: Vec<f64>,
    /// Tangential displacement, mm, by the full weight acting in the positive tangential direction.
    pub sag_tangential_mm: Vec<f64>,
    /// The one-sided rests, if there are any.
    pub contacts: Option<Contacts>,
}

impl Beam {
    /// Everything asked for at every station.
    ///
    /// Stations ascending, mm, on the shaft. At a station on a rigid support that holds both ways all values
    /// are exactly 0.
    pub fn profile(&self, stations_mm: &[f64], want: Wanted) -> Profile {
        if want.weight && !self.frame.is_weighed() {
            return self.weighed().profile(stations_mm, want);
        }
        match &self.steady {
            Some(steady) if !(self.is_changing() && want.weight) => self.steady_profile(steady, stations_mm, want),
            _ if self.follow.is_empty() => self.turning_profile(stations_mm, want),
            _ => self.moving_profile(stations_mm, want),
        }
    }

    /// From polynomials between the break points.
    fn steady_profile(&self, steady: &Steady, stations: &[f64], want: Wanted) -> Profile {
        let intervals = self.frame.intervals.len();
        let over = |piece: &dyn Fn(usize) -> Raised| self.sample((0..intervals).map(piece), stations);
        let radial = self.pieces(&self.radial, &steady.radial);
        let when = |wanted: bool, piece: &dyn Fn(usize) -> Raised| if wanted { over(piece) } else { Vec::new() };
        let mut profile = Profile {
            radial_mm_per_n: self.sample(steady.compliance.iter().copied(), stations),
            couple_per_n: when(want.couple, &|k| radial.coupling(k)),
            sag_radial_mm: when(want.weight, &|k| radial.sag(k)),
            ..Profile::default()
        };
        if want.tangential || want.weight {
            let plane = self.tangential();
            let factor = self.factor(&plane);
            let tangential = self.pieces(&plane, &factor);
            if want.tangential {
                profile.tangential_mm_per_n = self.sample(tangential.compliances().into_iter(), stations);
            }
            profile.sag_tangential_mm = when(want.weight, &|k| tangential.sag(k));
        }
        let rests = self.one_sided();
        if rests.is_empty() {
            return profile;
        }
        let mut contacts = self.open_contacts(&rests);
        let count = rests.len();
        for (slot, &row) in rests.iter().enumerate() {
            scatter(&mut contacts.influence, over(&|k| radial.at_rest(k, row)), slot, count);
            if want.couple {
                scatter(&mut contacts.couple_influence, over(&|k| radial.couple_at_rest(k, row)), slot, count);
            }
            let reactions = self.frame.reactions[row];
            let own = self.left.pair(intervals, row, row) + self.radial.base_work(reactions, reactions);
            let matrix = &steady.radial.matrix;
            contacts.matrix.extend(rests.iter().map(|&other| matrix.at(row, other)));
            contacts.matrix[slot * count + slot] += REGULARISATION * own;
            if want.weight {
                contacts.rest_sag.push(matrix.at(row, self.frame.columns()));
            }
        }
        contacts.attach(profile)
    }

    pub(super) fn sample(&self, forms: impl Iterator<Item = Raised>, stations: &[f64]) -> Vec<f64> {
        let mut values = Vec::with_capacity(stations.len());
        let mut rest = stations;
        let last = self.frame.intervals.len() - 1;
        for ((k, interval), form) in self.frame.intervals.iter().enumerate().zip(forms) {
            let count = if k == last { rest.len() } else { rest.partition_point(|place| *place < interval.end) };
            let (here, behind) = rest.split_at(count);
            let span = Span { start: interval.start, end: interval.end, inverse_length: 1.0 / interval.length };
            sample(&form, span, here, &mut values);
            rest = behind;
        }
        values
    }

    /// Block by block, for the partly turned shaft.
    fn turning_profile(&self, stations: &[f64], want: Wanted) -> Profile {
        let mut profile = Profile::with_room(stations.len(), want);
        let rests = self.one_sided();
        let mut contacts = self.open_contacts(&rests);
        let rows = Rows { couple: want.couple, weight: want.weight };
        Turning::new(self.bending(), &self.radial, rows).run(stations, |works, block| {
            let (force, count) = (works.force_row(), block.len());
            profile.radial_mm_per_n.extend_from_slice(&works.work(force, force)[..count]);
            if want.couple {
                profile.couple_per_n.extend_from_slice(&works.work(force, force + 1)[..count]);
            }
            if want.weight {
                profile.sag_radial_mm.extend_from_slice(&works.work(force, force + 2)[..count]);
            }
            for slot in (0..count).filter(|_| !rests.is_empty()) {
                works.note(&rests, slot, want, &mut contacts);
            }
        });
        if want.tangential || want.weight {
            let rows = Rows { couple: false, weight: want.weight };
            Turning::new(self.bending(), &self.tangential(), rows).run(stations, |works, block| {
                let force = works.force_row();
                if want.tangential {
                    profile.tangential_mm_per_n.extend_from_slice(&works.work(force, force)[..block.len()]);
                }
                if want.weight {
                    profile.sag_tangential_mm.extend_from_slice(&works.work(force, force + 2)[..block.len()]);
                }
            });
        }
        contacts.attach(profile)
    }

    /// Station by station, where more than the load moves with the tool.
    fn moving_profile(&self, stations: &[f64], want: Wanted) -> Profile {
        let mut profile = Profile::with_room(stations.len(), want);
        let rests = self.one_sided();
        let mut contacts = self.open_contacts(&rests);
        let rows = Rows { couple: want.couple, weight: want.weight };
        let mut works = Works::new(&self.frame, &self.left, &self.right, &self.follow, rows);
        let mut reduction = Reduction::default();
        let tangential = self.tangential();
        for &station in stations {
            let k = works.place(station);
            let (force, couple, weight) = (works.force_row(), works.couple_row(), works.weight_row());
            let free = f64::from(!self.radial.holds_tool(&self.frame, k, station));
            reduction.reduce(&works, &self.radial);
            let matrix = &reduction.matrix;
            profile.radial_mm_per_n.push(free * matrix.at(force, force));
            if want.couple {
                profile.couple_per_n.push(free * matrix.at(force, couple));
            }
            if want.weight {
                profile.sag_radial_mm.push(free * matrix.at(force, weight));
            }
            for slot in 0..rests.len() {
                reduction.note(&works, &self.radial, &rests, slot, free, want, &mut contacts);
            }
            if want.tangential || want.weight {
                let free = f64::from(!tangential.holds_tool(&self.frame, k, station));
                reduction.reduce(&works, &tangential);
                if want.tangential {
                    profile.tangential_mm_per_n.push(free * reduction.matrix.at(force, force));
                }
                if want.weight {
                    profile.sag_tangential_mm.push(free * reduction.matrix.at(force, weight));
                }
            }
        }
        contacts.attach(profile)
    }

    /// Rows of the one-sided rests: fixed ones, then follow rests.
    pub(super) fn one_sided(&self) -> Vec<usize> {
        let one_sided = |support: usize| self.supports[support].gap_mm().is_some();
        let fixed =
            (0..self.unknowns.len()).filter(|&i| !self.unknowns[i].couple && one_sided(self.unknowns[i].support));
        let follow = (0..self.follow.len()).filter(|&i| one_sided(self.follow[i].0));
        fixed.chain(follow.map(|i| self.frame.columns() + i)).collect()
    }

    fn open_contacts(&self, rows: &[usize]) -> Contacts {
        let columns = self.frame.columns();
        let supports: Vec<usize> = rows
            .iter()
            .map(|&row| if row < columns { self.unknowns[row].support } else { self.follow[row - columns].0 })
            .collect();
        Contacts {
            gaps_mm: supports.iter().map(|&support| self.supports[support].gap_mm().unwrap_or(0.0)).collect(),
            supports,
            ..Contacts::default()
        }
    }
}

impl Turning<'_> {
    /// All rests at one station of the block.
    fn note(&self, rests: &[usize], slot: usize, want: Wanted, into: &mut Contacts) {
        let force = self.force_row();
        for &row in rests {
            into.influence.push(self.work(row, force)[slot]);
            if want.couple {
                into.couple_influence.push(self.work(row, force + 1)[slot]);
            }
            if want.weight {
                into.rest_sag.push(self.work(row, force + 2)[slot]);
            }
            for &other in rests {
                let own = if row == other { REGULARISATION * self.original[row][slot] } else { 0.0 };
                into.matrix.push(self.work(row.min(other), row.max(other))[slot] + own);
            }
        }
    }
}

/// Writes the values of one rest into the rows of the stations.
fn scatter(into: &mut Vec<f64>, values: Vec<f64>, slot: usize, count: usize) {
    if count == 1 {
        *into = values;
        return;
    }
    into.resize(values.len() * count, 0.0);
    for (row, value) in into.chunks_exact_mut(count).zip(values) {
        row[slot] = value;
    }
}

/// Room for the elimination at one station.
#[derive(Default)]
pub(super) struct Reduction {
    pub(super) matrix: Symmetric,
    pub(super) redundants: Vec<usize>,
    pub(super) pivots: Vec<f64>,
    /// Diagonal before the elimination.
    original: Vec<f64>,
}

impl Reduction {
    pub(super) fn reduce(&mut self, works: &Works<'_>, plane: &Plane) {
        works.sprung(plane, &mut self.matrix);
        works.redundants(plane, &mut self.redundants);
        self.original.clear();
        self.original.extend((0..self.matrix.order).map(|i| self.matrix.at(i, i)));
        self.matrix.eliminate(&self.redundants, &mut self.pivots);
    }

    /// A rest that cannot act: beside the shaft, or at a place that is held rigidly already.
    pub(super) fn idle(&self, works: &Works<'_>, plane: &Plane, row: usize) -> bool {
        let own = plane.fixed.iter().chain(&plane.follow).nth(row).copied().unwrap_or(0.0);
        works.is_absent(row) || self.matrix.at(row, row) - own <= VANISHING * self.original[row]
    }

    /// One rest at one station; one that cannot act is written as one that nothing moves.
    #[allow(clippy::too_many_arguments)]
    fn note(
        &self,
        works: &Works<'_>,
        plane: &Plane,
        rests: &[usize],
        slot: usize,
        tool_free: f64,
        want: Wanted,
        into: &mut Contacts,
    ) {
        let row = rests[slot];
        let acting = f64::from(!self.idle(works, plane, row));
        let matrix = &self.matrix;
        into.influence.push(acting * tool_free * matrix.at(row, works.force_row()));
        if want.couple {
            into.couple_influence.push(acting * matrix.at(row, works.couple_row()));
        }
        if want.weight {
            into.rest_sag.push(acting * matrix.at(row, works.weight_row()));
        }
        for (other_slot, &other) in rests.iter().enumerate() {
            let both = acting * f64::from(!self.idle(works, plane, other));
            let own = if slot == other_slot { REGULARISATION * self.original[row] } else { 0.0 };
            into.matrix.push(both * (matrix.at(row, other) + own));
        }
    }
}

impl Profile {
    /// Empty, with room for what is wanted.
    fn with_room(count: usize, want: Wanted) -> Self {
        let room = |wanted: bool| Vec::with_capacity(if wanted { count } else { 0 });
        Self {
            radial_mm_per_n: room(true),
            couple_per_n: room(want.couple),
            tangential_mm_per_n: room(want.tangential),
            sag_radial_mm: room(want.weight),
            sag_tangential_mm: room(want.weight),
            contacts: None,
        }
    }
}

impl Contacts {
    /// Into the profile, if there are any rests, with what they need of it.
    fn attach(mut self, mut profile: Profile) -> Profile {
        if !self.supports.is_empty() {
            self.compliance.clone_from(&profile.radial_mm_per_n);
            self.coupling.clone_from(&profile.couple_per_n);
            self.sag.clone_from(&profile.sag_radial_mm);
            self.seal();
            profile.contacts = Some(self);
        }
        profile
    }

    /// A rest that cannot act has an empty row: a unit on the diagonal keeps the problem definite.
    fn seal(&mut self) {
        let count = self.supports.len();
        let square = count * count;
        for block in self.matrix.chunks_exact_mut(square) {
            for rest in 0..count {
                if block[rest * count + rest] <= 0.0 {
                    for other in 0..count {
                        block[rest * count + other] = 0.0;
                        block[other * count + rest] = 0.0;
                    }
                    block[rest * count + rest] = 1.0;
                }
            }
        }
    }
}
