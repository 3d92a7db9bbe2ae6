//! The largest and smallest of what a cut reaches along the shaft, in one pass over its stations.

use crate::deflection_compensation::model::stage::Stage;
use crate::deflection_compensation::model::yielding::at;

/// What a cut reaches along the shaft.
#[derive(Debug)]
pub(in crate::deflection_compensation) struct Extremes {
    /// Elastic deflection over the nominal depth, where something is to be cut.
    pub elastic_over_depth: LargestRatio,
    /// Displacement of the axis, radial or tangential, mm.
    pub moved_mm: f64,
    /// The same over the diameter.
    pub moved_over_diameter: LargestRatio,
    /// By how much the stock is thinner than the drawing, radial, mm.
    pub undersize_mm: f64,
    /// Commanded depth, mm.
    pub commanded_mm: f64,
    /// The same over the nominal depth, where something is to be cut.
    pub commanded_over_depth: LargestRatio,
    /// Nominal depth where something is to be cut, mm; infinite where nothing is.
    pub least_depth_mm: f64,
    /// The largest of them, 0 where there is none.
    pub largest_depth_mm: f64,
}

/// The largest of ratios of which the lower part is positive: compared crosswise and divided but once, at the end.
#[derive(Debug)]
pub(in crate::deflection_compensation) struct LargestRatio {
    above: f64,
    below: f64,
}

impl LargestRatio {
    const ZERO: Self = Self { above: 0.0, below: 1.0 };

    #[inline]
    fn meet(&mut self, above: f64, below: f64) {
        if above * self.below > self.above * below {
            (self.above, self.below) = (above, below);
        }
    }

    /// The largest ratio met, at least 0.
    pub(in crate::deflection_compensation) fn value(&self) -> f64 {
        self.above / self.below
    }
}

impl Extremes {
    /// Of a computed cut.
    pub(in crate::deflection_compensation) fn of(stage: &Stage) -> Self {
        let mut most = Self {
            elastic_over_depth: LargestRatio::ZERO,
            moved_mm: 0.0,
            moved_over_diameter: LargestRatio::ZERO,
            undersize_mm: 0.0,
            commanded_mm: 0.0,
            commanded_over_depth: LargestRatio::ZERO,
            least_depth_mm: f64::INFINITY,
            largest_depth_mm: 0.0,
        };
        let cut = &stage.cut;
        let radii = stage.radii.target.iter().zip(&stage.radii.stock);
        let states = cut.nominal_depth_mm.iter().zip(&cut.y_mm).zip(&cut.command_mm);
        for (i, ((target, stock), ((depth, y), command))) in radii.zip(states).enumerate() {
            let elastic = stage.line.elastic_mm(i, *y);
            most.meet_radii(*target, *stock, elastic.abs().max(at(&cut.z_mm, i).abs()));
            let commanded = command.map(|command| stock - command);
            raise(&mut most.commanded_mm, commanded.unwrap_or(0.0));
            if *depth > 0.0 {
                most.meet_depth(*depth, elastic, commanded.unwrap_or(0.0));
            }
        }
        most
    }

    #[inline]
    fn meet_radii(&mut self, target_mm: f64, stock_mm: f64, moved_mm: f64) {
        raise(&mut self.moved_mm, moved_mm);
        self.moved_over_diameter.meet(moved_mm, 2.0 * target_mm);
        raise(&mut self.undersize_mm, target_mm - stock_mm);
    }

    #[inline]
    fn meet_depth(&mut self, depth_mm: f64, elastic_mm: f64, commanded_mm: f64) {
        self.elastic_over_depth.meet(elastic_mm, depth_mm);
        self.commanded_over_depth.meet(commanded_mm, depth_mm);
        raise(&mut self.largest_depth_mm, depth_mm);
        if depth_mm < self.least_depth_mm {
            self.least_depth_mm = depth_mm;
        }
    }
}

/// By comparison: `f64::max` also settles NaN, at three times the cost.
#[inline]
fn raise(most: &mut f64, value: f64) {
    if value > *most {
        *most = value;
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_ratio_is_that_of_the_quotients() {
        let mut largest = LargestRatio::ZERO;
        for (above, below) in [(-1.0, 2.0), (1.0, 4.0), (3.0, 10.0), (0.5, 2.5)] {
            largest.meet(above, below);
        }
        assert_eq!(largest.value(), 0.3);
        assert_eq!(LargestRatio::ZERO.value(), 0.0);
    }
}
