//! Readings from compliances (`library/7`), and how they change with each.
//!
//! reading = F W(z_load, z_reading; c) + sign(F) p, W the displacement at the gauge by a unit force at the load, of the bar on
//! its springs; at the tool F c_t + sign(F) p_t. By the theorem of Menabrea and Castigliano a spring's share is
//! dW/dc_i = R_i(z_load) R_i(z_reading), R_i its reaction to a unit force, for a couple the same with couples: exact however
//! the bar is held.

use crate::num::beam::{self, Beam, Springs, State};
use crate::num::dense::Columns;
use crate::num::lsq;

use super::input::{BarSegment, GaugeRow, GaugedAt, Job, TestSupport};
use super::output::Part;

const UM_PER_MM: f64 = 1e3;

/// Something that is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// Radial compliance of a support, um/N.
    Radial(usize),
    /// Rotational compliance of a chuck, rad/(N mm).
    Rotation(usize),
    /// Carriage and tool post, um/N.
    Carriage,
    /// Play at the bar, um.
    PlayAtWork,
    /// Play at the tool post, um.
    PlayAtTool,
}

impl Unknown {
    /// Where the search begins: a lathe of medium stiffness.
    fn start(self) -> f64 {
        match self {
            Self::Radial(_) | Self::Carriage => 0.03,
            Self::Rotation(_) => 1e-9,
            Self::PlayAtWork | Self::PlayAtTool => 1.0,
        }
    }
}

/// What a job leaves open: as far as a gauge stood where it shows.
pub(super) fn unknowns(job: &Job) -> Vec<Unknown> {
    let read_at = |at: GaugedAt| job.measurements.rows().iter().any(|row| row.gauged_at() == at);
    let mut found = Vec::new();
    if read_at(GaugedAt::Work) {
        for (index, support) in job.supports.iter().enumerate() {
            if support.compliance_um_per_n().is_none() {
                found.push(Unknown::Radial(index));
            }
            if let TestSupport::Chuck { rotational_compliance_rad_per_n_mm: None, .. } = support {
                found.push(Unknown::Rotation(index));
            }
        }
        found.extend(job.play.then_some(Unknown::PlayAtWork));
    }
    if read_at(GaugedAt::Tool) {
        found.extend(job.carriage_um_per_n.is_none().then_some(Unknown::Carriage));
        found.extend(job.play.then_some(Unknown::PlayAtTool));
    }
    found
}

/// A reading and how it changes with each unknown, um and um per unit of the unknown.
pub(super) struct Predicted {
    pub reading_um: f64,
    /// What of it is the bending of the bar.
    pub bending_um: f64,
    pub slopes: Vec<f64>,
}

/// The test as a function of the unknowns.
pub(super) struct Model<'a> {
    pub job: &'a Job,
    pub unknowns: Vec<Unknown>,
    segments: Vec<beam::Segment>,
}

impl<'a> Model<'a> {
    /// Of a checked and filled job.
    pub(super) fn new(job: &'a Job) -> Self {
        let material = beam::Material {
            youngs_modulus_n_per_mm2: job.bar.youngs_modulus_n_per_mm2.unwrap_or(f64::NAN),
            poisson_ratio: job.bar.poisson_ratio.unwrap_or(f64::NAN),
            density_kg_per_m3: 0.0,
            gravity_m_per_s2: 0.0,
        };
        let segment = |of: &BarSegment| {
            let section =
                beam::Section::round(of.diameter_mm, of.bore_diameter_mm, &material, beam::Theory::Timoshenko);
            beam::Segment { length_mm: of.length_mm, finished: section, stock: section }
        };
        Self { job, unknowns: unknowns(job), segments: job.bar.segments.iter().map(segment).collect() }
    }

    /// Where the search begins.
    pub(super) fn start(&self) -> Vec<f64> {
        self.unknowns.iter().map(|unknown| unknown.start()).collect()
    }

    fn value(&self, unknown: Unknown, values: &[f64]) -> Option<f64> {
        self.unknowns.iter().position(|one| *one == unknown).map(|at| values[at])
    }

    /// The bar on its springs; `None` where it does not stand.
    fn beam(&self, values: &[f64]) -> Option<Beam> {
        let springs = |index: usize| Springs {
            radial_mm_per_n: self.radial_um_per_n(index, values) / UM_PER_MM,
            tangential_mm_per_n: 0.0,
        };
        let support = |(index, support): (usize, &TestSupport)| match *support {
            TestSupport::Centre { z_mm, .. } => beam::Support::Centre { z_mm, springs: springs(index) },
            TestSupport::SteadyRest { z_mm, .. } => {
                beam::Support::SteadyRest { z_mm, springs: springs(index), contact: beam::Contact::Bilateral }
            }
            TestSupport::Chuck { z_mm, .. } => beam::Support::Chuck {
                z_mm,
                springs: springs(index),
                rotational_rad_per_n_mm: self.rotation_rad_per_n_mm(index, values),
            },
        };
        let supports: Vec<beam::Support> = self.job.supports.iter().enumerate().map(support).collect();
        Beam::new(&self.segments, &supports, State::Finished).ok()
    }

    /// What the gauge reads in each row at these values; `None` where the bar does not stand.
    pub(super) fn predict(&self, values: &[f64], rows: &[GaugeRow]) -> Option<Vec<Predicted>> {
        let beam = self.beam(values)?;
        rows.iter().map(|row| self.row(&beam, values, row)).collect()
    }

    fn row(&self, beam: &Beam, values: &[f64], row: &GaugeRow) -> Option<Predicted> {
        let (force, sign) = (row.force_n, if row.force_n < 0.0 { -1.0 } else { 1.0 });
        if row.gauged_at() == GaugedAt::Tool {
            let carriage = self.job.carriage_um_per_n.or(self.value(Unknown::Carriage, values)).unwrap_or(0.0);
            let play = self.value(Unknown::PlayAtTool, values).unwrap_or(0.0);
            let slope = |unknown: &Unknown| match unknown {
                Unknown::Carriage => force,
                Unknown::PlayAtTool => sign,
                _ => 0.0,
            };
            let slopes = self.unknowns.iter().map(slope).collect();
            return Some(Predicted { reading_um: force * carriage + sign * play, bending_um: 0.0, slopes });
        }
        let load = row.z_load_mm?;
        let reading = row.z_reading_mm.unwrap_or(load);
        let moved_mm = *beam.influence(load, &[reading], None).ok()?.first()?;
        let (by_load, by_reading) = (beam.reactions(load), beam.reactions(reading));
        let slope = |unknown: &Unknown| match *unknown {
            // c in um/N: the factors of both units are one another's inverse.
            Unknown::Radial(i) => force * by_load[i].force * by_reading[i].force,
            Unknown::Rotation(i) => UM_PER_MM * force * by_load[i].couple_mm * by_reading[i].couple_mm,
            Unknown::PlayAtWork => sign,
            Unknown::Carriage | Unknown::PlayAtTool => 0.0,
        };
        let slopes = self.unknowns.iter().map(slope).collect();
        let play = self.value(Unknown::PlayAtWork, values).unwrap_or(0.0);
        let yielding_um: f64 = (0..self.job.supports.len())
            .map(|i| {
                let moved = self.radial_um_per_n(i, values) * by_load[i].force * by_reading[i].force;
                let turned = self.rotation_rad_per_n_mm(i, values) * by_load[i].couple_mm * by_reading[i].couple_mm;
                force * (moved + UM_PER_MM * turned)
            })
            .sum();
        let sprung_um = UM_PER_MM * force * moved_mm;
        Some(Predicted { reading_um: sprung_um + sign * play, bending_um: sprung_um - yielding_um, slopes })
    }

    fn radial_um_per_n(&self, index: usize, values: &[f64]) -> f64 {
        let known = self.job.supports[index].compliance_um_per_n();
        known.or(self.value(Unknown::Radial(index), values)).unwrap_or(0.0)
    }

    fn rotation_rad_per_n_mm(&self, index: usize, values: &[f64]) -> f64 {
        match self.job.supports[index] {
            TestSupport::Chuck { rotational_compliance_rad_per_n_mm: known, .. } => {
                known.or(self.value(Unknown::Rotation(index), values)).unwrap_or(0.0)
            }
            TestSupport::Centre { .. } | TestSupport::SteadyRest { .. } => 0.0,
        }
    }

    /// What of the machine an unknown is.
    pub(super) fn part(&self, unknown: Unknown) -> Part {
        match unknown {
            Unknown::Carriage => Part::Carriage,
            Unknown::PlayAtWork => Part::PlayAtWork,
            Unknown::PlayAtTool => Part::PlayAtTool,
            Unknown::Rotation(_) => Part::HeadstockRotation,
            Unknown::Radial(index) => {
                let supports = &self.job.supports;
                let z = supports[index].z_mm();
                let is_tail = supports.iter().any(|other| other.z_mm() < z);
                match supports[index] {
                    TestSupport::SteadyRest { .. } => Part::SteadyRest,
                    TestSupport::Centre { .. } if is_tail => Part::Tailstock,
                    TestSupport::Centre { .. } | TestSupport::Chuck { .. } => Part::Headstock,
                }
            }
        }
    }

    /// Where a machine's record keeps a number; nowhere for play, and for rests that only their names tell apart.
    pub(super) fn place_in_record(&self, unknown: Unknown) -> Option<&'static str> {
        let rests = || self.job.supports.iter().filter(|one| matches!(one, TestSupport::SteadyRest { .. })).count();
        match (self.part(unknown), unknown) {
            (Part::Headstock, Unknown::Radial(index)) => match self.job.supports[index] {
                TestSupport::Chuck { .. } => Some("/compliance/headstock_chuck_um_per_n"),
                _ => Some("/compliance/headstock_centre_um_per_n"),
            },
            (Part::HeadstockRotation, _) => Some("/compliance/headstock_chuck_rotation_rad_per_n_mm"),
            (Part::Tailstock, _) => Some("/compliance/tailstock_centre_um_per_n"),
            (Part::SteadyRest, _) if rests() == 1 => Some("/compliance/steady_rest_um_per_n"),
            (Part::Carriage, _) => Some("/compliance/carriage_um_per_n"),
            _ => None,
        }
    }

    /// Slopes in units of the gauge's error, column by column.
    pub(super) fn slopes(&self, values: &[f64], rows: &[GaugeRow]) -> Option<Columns> {
        let predicted = self.predict(values, rows)?;
        let mut columns = Columns::zeros(rows.len(), self.unknowns.len());
        for (i, row) in predicted.iter().enumerate() {
            for (j, slope) in row.slopes.iter().enumerate() {
                columns.set(i, j, slope / self.job.gauge_error_um);
            }
        }
        Some(columns)
    }
}

impl lsq::Model for Model<'_> {
    fn residual_count(&self) -> usize {
        self.job.measurements.rows().len()
    }

    fn residuals(&self, values: &[f64], into: &mut [f64]) {
        let rows = self.job.measurements.rows();
        match self.predict(values, rows) {
            Some(predicted) => {
                for ((into, predicted), row) in into.iter_mut().zip(&predicted).zip(rows) {
                    *into = (predicted.reading_um - row.reading_um) / self.job.gauge_error_um;
                }
            }
            None => into.fill(f64::NAN),
        }
    }

    fn jacobian(&self, values: &[f64], into: &mut Columns) -> bool {
        match self.slopes(values, self.job.measurements.rows()) {
            Some(slopes) => {
                *into = slopes;
                true
            }
            None => false,
        }
    }
}
