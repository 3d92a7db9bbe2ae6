//! What a beam is made of: segments, supports, and which section counts.

use super::section::Section;

/// One cylindrical piece of the shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Length, mm, > 0.
    pub length_mm: f64,
    /// The section after turning.
    pub finished: Section,
    /// The section before turning.
    pub stock: Section,
}

/// A side of the tool along the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `s < x`, toward the headstock.
    Left,
    /// `s > x`, toward the tailstock.
    Right,
}

/// Which section stiffens the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The finished one everywhere.
    Finished,
    /// The stock everywhere.
    Stock,
    /// Partly turned: stock on one side of the tool, finished on the other one.
    Mixed {
        /// The side not yet turned: `Left` for feed to the headstock.
        stock_side: Side,
    },
}

/// Translational compliances of a support in the two planes; 0 is rigid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Springs {
    /// In the radial direction `u`, mm/N, >= 0.
    pub radial_mm_per_n: f64,
    /// In the tangential direction `w`, mm/N, >= 0.
    pub tangential_mm_per_n: f64,
}

/// How a rest touches the work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contact {
    /// Holds in both directions.
    Bilateral,
    /// In `u` acts only when the work has moved away from the tool by more than the gap; bilateral in `w`.
    OneSided {
        /// Gap from the undeflected axis, mm, >= 0.
        gap_mm: f64,
    },
}

/// What holds the shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Support {
    /// Translational.
    Centre {
        /// Place along the shaft, mm.
        z_mm: f64,
        /// Compliances.
        springs: Springs,
    },
    /// Translational and rotational; the shaft may continue on both sides.
    Chuck {
        /// Place along the shaft, mm.
        z_mm: f64,
        /// Compliances.
        springs: Springs,
        /// Rotational compliance in both planes, rad/(N mm), >= 0; 0 clamps.
        rotational_rad_per_n_mm: f64,
    },
    /// A rest that stands still.
    SteadyRest {
        /// Place along the shaft, mm.
        z_mm: f64,
        /// Compliances.
        springs: Springs,
        /// Both ways or one.
        contact: Contact,
    },
    /// A rest that moves with the tool and acts while it is on the shaft.
    FollowRest {
        /// Place relative to the tool, mm, > 0 toward the tailstock.
        offset_mm: f64,
        /// Compliances.
        springs: Springs,
        /// Both ways or one.
        contact: Contact,
    },
}

impl Support {
    pub(super) fn springs(&self) -> Springs {
        match *self {
            Self::Centre { springs, .. }
            | Self::Chuck { springs, .. }
            | Self::SteadyRest { springs, .. }
            | Self::FollowRest { springs, .. } => springs,
        }
    }

    /// Place of a support that stands still.
    pub(super) fn fixed_z_mm(&self) -> Option<f64> {
        match *self {
            Self::Centre { z_mm, .. } | Self::Chuck { z_mm, .. } | Self::SteadyRest { z_mm, .. } => Some(z_mm),
            Self::FollowRest { .. } => None,
        }
    }

    pub(super) fn rotational(&self) -> Option<f64> {
        match *self {
            Self::Chuck { rotational_rad_per_n_mm, .. } => Some(rotational_rad_per_n_mm),
            _ => None,
        }
    }

    pub(super) fn gap_mm(&self) -> Option<f64> {
        match *self {
            Self::SteadyRest { contact: Contact::OneSided { gap_mm }, .. }
            | Self::FollowRest { contact: Contact::OneSided { gap_mm }, .. } => Some(gap_mm),
            _ => None,
        }
    }

    /// The place of a support that stands still and holds both ways in the radial plane.
    pub(super) fn bilateral_z_mm(&self) -> Option<f64> {
        if self.gap_mm().is_some() { None } else { self.fixed_z_mm() }
    }
}

/// Why a beam cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BeamError {
    /// There is no segment.
    #[error("the shaft has no segment")]
    NoSegment,
    /// A length is not a positive finite number, or a section is not stiff and finite.
    #[error("segment {segment} has no positive length or no positive stiffness")]
    BadSegment {
        /// Which, from 0.
        segment: usize,
    },
    /// A support stands beside the shaft.
    #[error("support {support} is not on the shaft")]
    SupportOutside {
        /// Which, from 0.
        support: usize,
    },
    /// Two supports at one place.
    #[error("support {support} stands where another one is")]
    DuplicateSupport {
        /// The later one, from 0.
        support: usize,
    },
    /// A compliance, gap or offset is negative or not finite.
    #[error("support {support} has a compliance, gap or offset that is negative or not finite")]
    BadSupport {
        /// Which, from 0.
        support: usize,
    },
    /// Neither two bilateral fixed supports nor a chuck.
    #[error("the shaft is not held: it needs two bilateral supports or a chuck")]
    Unstable,
    /// More one-sided rests than [`super::MAX_ONE_SIDED_RESTS`].
    #[error("too many one-sided rests: {count}")]
    TooManyOneSidedRests {
        /// How many were given.
        count: usize,
    },
}

/// A support may stand beyond the end of the shaft by this share of its length: the sum of the segments' lengths
/// and a place typed by hand differ by rounding.
const END_TOLERANCE: f64 = 1e-9;

/// Refuses what cannot be computed; otherwise the length of the shaft, mm.
pub(super) fn validate(segments: &[Segment], supports: &[Support]) -> Result<f64, BeamError> {
    if segments.is_empty() {
        return Err(BeamError::NoSegment);
    }
    for (segment, given) in segments.iter().enumerate() {
        let long = given.length_mm.is_finite() && given.length_mm > 0.0;
        if !(long && given.finished.is_valid() && given.stock.is_valid()) {
            return Err(BeamError::BadSegment { segment });
        }
    }
    let length_mm: f64 = segments.iter().map(|segment| segment.length_mm).sum();
    for (support, given) in supports.iter().enumerate() {
        let springs = given.springs();
        let numbers = [
            springs.radial_mm_per_n,
            springs.tangential_mm_per_n,
            given.rotational().unwrap_or(0.0),
            given.gap_mm().unwrap_or(0.0),
        ];
        let offset = if let Support::FollowRest { offset_mm, .. } = given { *offset_mm } else { 0.0 };
        if !offset.is_finite() || numbers.iter().any(|number| !number.is_finite() || *number < 0.0) {
            return Err(BeamError::BadSupport { support });
        }
        if let Some(z) = given.fixed_z_mm() {
            let on_the_shaft = z >= -END_TOLERANCE * length_mm && z <= length_mm * (1.0 + END_TOLERANCE);
            if !on_the_shaft {
                return Err(BeamError::SupportOutside { support });
            }
            #[allow(clippy::float_cmp, reason = "one place is one place when it is typed the same")]
            let twice = supports[..support].iter().any(|other| other.fixed_z_mm() == Some(z));
            if twice {
                return Err(BeamError::DuplicateSupport { support });
            }
        }
    }
    let count = supports.iter().filter(|support| support.gap_mm().is_some()).count();
    if count > super::MAX_ONE_SIDED_RESTS {
        return Err(BeamError::TooManyOneSidedRests { count });
    }
    Ok(length_mm)
}
