//! The handbook's power law for turning, with its correction factors.
//!
//! A choice of work material, tool material and edge geometry stands for one `PowerLaw`:
//! coefficients of the row, times K_p = K_m K_phi K_gamma K_lambda K_r. Angles are interpolated
//! linearly, the radius log-log; nothing is extrapolated, and what the tables do not give is asked
//! for, never invented.

mod factors;
mod input;
mod material_factor;
mod resolve;
mod rows;

pub use factors::{
    FactorRow, INCLINATION, LEAD_ANGLE_CARBIDE, LEAD_ANGLE_HSS, NOSE_RADIUS_HSS, RAKE_CARBIDE, RAKE_HSS,
};
pub use input::Handbook;
pub use material_factor::WorkMaterial;
pub(super) use resolve::LAST_EDGE_ANGLE_DEG;
pub use rows::{ALUMINIUM, COPPER, Coefficients, GREY_IRON, HandbookRow, MALLEABLE_IRON, STAINLESS, STEEL};

/// The handbook.
pub const SOURCE: &str = "A. G. Kosilova, R. K. Meshcheryakov (eds.), Spravochnik tekhnologa-mashinostroitelya (Handbook of the process engineer), vol. 2, 4th ed., Mashinostroenie, Moscow 1985, tables 9, 10, 22, 23";

/// A value for each component: main P_z, passive P_y, feed P_x, the order of the handbook.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triple {
    /// Of P_z.
    pub main: f64,
    /// Of P_y.
    pub passive: f64,
    /// Of P_x.
    pub feed: f64,
}

impl Triple {
    /// The same for all.
    pub const ONE: Self = Self::of(1.0, 1.0, 1.0);

    /// P_z, P_y, P_x.
    pub const fn of(main: f64, passive: f64, feed: f64) -> Self {
        Self { main, passive, feed }
    }

    fn times(self, other: Self) -> Self {
        Self::of(self.main * other.main, self.passive * other.passive, self.feed * other.feed)
    }
}
