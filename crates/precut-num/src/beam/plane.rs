//! Springs of one of the two planes, and which unknowns are redundants there.

use super::frame::{Base, Frame, Load};
use super::matrix::Symmetric;
use super::model::Support;

/// The direction of a displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// `u`: one-sided rests are open.
    Radial,
    /// `w`: one-sided rests hold both ways.
    Tangential,
}

impl Direction {
    fn compliance(self, support: &Support) -> f64 {
        match self {
            Self::Radial => support.springs().radial_mm_per_n,
            Self::Tangential => support.springs().tangential_mm_per_n,
        }
    }

    fn holds(self, support: &Support) -> bool {
        self == Self::Tangential || support.gap_mm().is_none()
    }
}

/// What an unknown belongs to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unknown {
    /// Index of the support.
    pub(super) support: usize,
    /// Whether it is the couple of a chuck.
    pub(super) couple: bool,
}

/// The unknowns that stand still, in the order of the frame's loads: all that the base does not carry.
pub(super) fn fixed_unknowns(supports: &[Support], base: &Base) -> (Vec<Unknown>, Vec<Load>) {
    let mut unknowns = Vec::new();
    let mut loads = Vec::new();
    for (support, given) in supports.iter().enumerate() {
        let Some(z) = given.fixed_z_mm() else { continue };
        if !base.supports.contains(&support) {
            unknowns.push(Unknown { support, couple: false });
            loads.push(Load { z, couple: false });
        }
        if given.rotational().is_some() && !base.is_chuck() {
            unknowns.push(Unknown { support, couple: true });
            loads.push(Load { z, couple: true });
        }
    }
    (unknowns, loads)
}

/// Springs of a plane.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    /// Of the base's two generalised reactions.
    pub(super) base: [f64; 2],
    /// Of the fixed unknowns.
    pub(super) fixed: Vec<f64>,
    /// Of the follow rests.
    pub(super) follow: Vec<f64>,
    /// The fixed unknowns that hold both ways: redundants.
    pub(super) redundants: Vec<usize>,
    /// The follow rests that hold both ways.
    pub(super) bilateral_follow: Vec<usize>,
    /// Break points at which a rigid support stands that holds both ways.
    rigid: Vec<usize>,
    /// A rigid follow rest that holds both ways stands at the tool.
    rigid_at_tool: bool,
}

impl Plane {
    pub(super) fn new(
        direction: Direction,
        supports: &[Support],
        unknowns: &[Unknown],
        frame: &Frame,
        follow: &[(usize, f64)],
    ) -> Self {
        let first = &supports[frame.base.supports[0]];
        let second = if frame.base.is_chuck() {
            first.rotational().unwrap_or(0.0)
        } else {
            direction.compliance(&supports[frame.base.supports[1]])
        };
        let fixed = unknowns
            .iter()
            .map(|unknown| {
                let support = &supports[unknown.support];
                if unknown.couple { support.rotational().unwrap_or(0.0) } else { direction.compliance(support) }
            })
            .collect();
        let redundants = (0..unknowns.len())
            .filter(|&i| unknowns[i].couple || direction.holds(&supports[unknowns[i].support]))
            .collect();
        let bilateral_follow: Vec<usize> =
            (0..follow.len()).filter(|&i| direction.holds(&supports[follow[i].0])).collect();
        let follow_compliance: Vec<f64> = follow.iter().map(|&(i, _)| direction.compliance(&supports[i])).collect();
        let stiff = |compliance: f64| compliance <= 0.0;
        let node = |z: f64| frame.intervals.partition_point(|interval| interval.start < z);
        let rigid = supports
            .iter()
            .filter(|support| direction.holds(support) && stiff(direction.compliance(support)))
            .filter_map(|support| support.fixed_z_mm().map(node))
            .collect();
        let rigid_at_tool = bilateral_follow.iter().any(|&i| stiff(follow_compliance[i]) && follow[i].1.abs() <= 0.0);
        Self {
            base: [direction.compliance(first), second],
            fixed,
            follow: follow_compliance,
            redundants,
            bilateral_follow,
            rigid,
            rigid_at_tool,
        }
    }

    /// A rigid support that holds both ways stands at the break point.
    pub(super) fn is_rigid(&self, node: usize) -> bool {
        self.rigid.contains(&node)
    }

    /// The tool stands, in this interval, on a rigid support that holds both ways.
    pub(super) fn holds_tool(&self, frame: &Frame, interval: usize, place: f64) -> bool {
        let Some(found) = frame.intervals.get(interval) else { return false };
        self.rigid_at_tool
            || (self.is_rigid(interval) && place <= found.start && place >= found.start)
            || (self.is_rigid(interval + 1) && place <= found.end && place >= found.end)
    }

    /// Share of the base's springs in the work of two loads with these reactions.
    pub(super) fn base_work(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        a[0] * b[0] * self.base[0] + a[1] * b[1] * self.base[1]
    }
}

/// The structure whose section does not change with the tool: redundants eliminated once and for all.
#[derive(Debug, Clone)]
pub(super) struct Factor {
    /// Rows of the fixed unknowns and last in a weighed frame the weight; see [`Symmetric::eliminate`].
    pub(super) matrix: Symmetric,
    /// Inverse roots of the pivots, in the order of the redundants.
    pub(super) pivots: Vec<f64>,
}

impl Factor {
    /// `pair` gives bending and shear work of two diagrams.
    pub(super) fn new(frame: &Frame, plane: &Plane, pair: impl Fn(usize, usize) -> f64) -> Self {
        let order = frame.width();
        let mut matrix = Symmetric::zeros(order);
        for i in 0..order {
            for j in i..order {
                matrix.add(i, j, pair(i, j) + plane.base_work(frame.reactions[i], frame.reactions[j]));
            }
            if let Some(compliance) = plane.fixed.get(i) {
                matrix.add(i, i, *compliance);
            }
        }
        matrix.mirror();
        let mut pivots = Vec::new();
        matrix.eliminate(&plane.redundants, &mut pivots);
        Self { matrix, pivots }
    }
}
