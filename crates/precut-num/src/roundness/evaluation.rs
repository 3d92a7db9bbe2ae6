//! The evaluation of a profile in the order of the standard.

use super::{
    Filter, Grid, Harmonic, LeastSquares, MaximumInscribed, MinimumCircumscribed, MinimumZone, RoundnessError, Section,
    least_squares, look, maximum_inscribed, minimum_circumscribed, minimum_zone, refer,
};

/// The four reference circles of one section.
#[derive(Debug, Clone, PartialEq)]
pub struct Circles {
    /// LSCI, with RONp, RONv and RONq.
    pub least_squares: LeastSquares,
    /// MZCI.
    pub minimum_zone: MinimumZone,
    /// MICI.
    pub inscribed: MaximumInscribed,
    /// MCCI.
    pub circumscribed: MinimumCircumscribed,
}

/// All four reference circles; at least three points that are not on a line. On an arc that surrounds no centre an
/// inscribed circle grows without limit: the one about the least-squares centre stands in its place, unproven.
pub fn circles(section: &Section, goes_on: &dyn Fn() -> bool) -> Result<Circles, RoundnessError> {
    let least_squares = least_squares(section, goes_on)?;
    let centre = least_squares.circle.centre_mm;
    Ok(Circles {
        least_squares,
        minimum_zone: minimum_zone(section, centre, goes_on)?,
        inscribed: inscribed_or_about(section, centre, goes_on)?,
        circumscribed: minimum_circumscribed(section, centre, goes_on)?,
    })
}

fn inscribed_or_about(
    section: &Section,
    centre: [f64; 2],
    goes_on: &dyn Fn() -> bool,
) -> Result<MaximumInscribed, RoundnessError> {
    match maximum_inscribed(section, centre, goes_on) {
        Err(RoundnessError::NotSurrounding) => Ok(MaximumInscribed::unproven_about(section, centre)),
        found => found,
    }
}

/// Everything that is evaluated of one section.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Circles of the points as they are.
    pub unfiltered: Circles,
    /// Distances from the least-squares centre of the points at n uniform angles from 0, mm.
    pub referred_mm: Vec<f64>,
    /// The same after the filter, mm.
    pub filtered_profile_mm: Vec<f64>,
    /// Circles of the filtered profile; centres are relative to the least-squares centre of the points.
    pub filtered: Circles,
    /// Harmonics of the referred profile before the filter, from 1.
    pub spectrum: Vec<Harmonic>,
}

/// Circles of the points; the profile referred to their least-squares centre on `grid`; filter; circles of the filtered
/// profile; spectrum up to `highest`. The points must follow each other counter-clockwise round the centre.
pub fn evaluate(
    section: &Section,
    grid: &Grid,
    filter: Filter,
    highest: usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<Evaluation, RoundnessError> {
    let unfiltered = circles(section, goes_on)?;
    look(goes_on)?;
    let referred_mm = refer(section, unfiltered.least_squares.circle.centre_mm, grid.len())?;
    look(goes_on)?;
    let filtered_profile_mm = grid.filtered(&referred_mm, filter)?;
    let filtered = circles(&grid.section(&filtered_profile_mm)?, goes_on)?;
    look(goes_on)?;
    let spectrum = grid.spectrum(&referred_mm, highest)?;
    Ok(Evaluation { unfiltered, referred_mm, filtered_profile_mm, filtered, spectrum })
}
