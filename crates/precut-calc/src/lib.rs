//! The pure compute core of `precut`.
//!
//! No async, no I/O, no clock, no HTTP, no global state: a job in, an answer out, and
//! [`calculator::Monitor`] as the only window. Lengths are mm, forces N, angles rad, stresses N/mm²
//! inside; micrometres and degrees only at the border, where every field's name carries its unit.

pub mod calculator;
pub mod certainty;
pub mod clamping;
pub mod compliance_fit;
pub mod deflection_compensation;
pub mod diagnosis;
mod diameters;
pub mod effects;
pub mod feed_schedule;
pub mod fixture_stability;
pub mod force;
pub mod machinability;
pub mod material;
pub mod milling_stability;
pub mod path;
pub mod process;
pub mod program_compensation;
pub mod receptance_fit;
pub mod ring_clamping;
pub mod ring_roundness;
pub mod shaft;
pub mod turning;

pub use precut_num as num;

use calculator::Registrar;

/// Every calculator, one line each. Nothing else has to change when one moves in: those that can be diagnosed make up
/// the calculator `diagnosis`.
pub fn register(registrar: &mut impl Registrar) {
    registrar.watched::<deflection_compensation::DeflectionCompensation>();
    registrar.diagnosable::<ring_roundness::RingRoundness>();
    registrar.calculator::<ring_roundness::evaluation::RoundnessEvaluation>();
    registrar.calculator::<ring_roundness::cylindricity::CylindricityEvaluation>();
    registrar.calculator::<ring_clamping::RingClamping>();
    registrar.diagnosable::<feed_schedule::FeedSchedule>();
    registrar.calculator::<feed_schedule::fit::MachinabilityFit>();
    registrar.diagnosable::<fixture_stability::FixtureStability>();
    registrar.calculator::<fixture_stability::identification::FixtureIdentification>();
    registrar.diagnosable::<milling_stability::MillingStability>();
    registrar.calculator::<compliance_fit::ComplianceFit>();
    registrar.calculator::<receptance_fit::ReceptanceFit>();
    registrar.diagnosable::<program_compensation::ProgramCompensation>();
}
