//! Ways of a tool in the work: how deep they lie in it, and what they take away (`program/3`).

use super::super::super::job::ProgramTool;
use super::chain::Chain;
use super::curve::{Curve, Piece};
use super::edges::EdgeEnds;
use super::sweep::{Shape, Swept, Way};

impl Chain {
    /// How deep a way lies in the work, mm; below 0 it stays clear.
    pub(crate) fn depth_of(&mut self, shape: &Shape, way: &Way) -> f64 {
        shape.sweep(way).pieces.iter().map(|piece| self.depth(piece)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether a way lies deeper in the work than so much.
    pub(crate) fn reaches(&mut self, shape: &Shape, way: &Way, depth_mm: f64) -> bool {
        // What the end of it makes is in the work first.
        shape.sweep(way).pieces.iter().rev().any(|piece| self.depth_up_to(piece, depth_mm) > depth_mm)
    }

    /// The same of a tool that ends where its edges do, where it says how long these are.
    pub(super) fn depth_of_tool(&mut self, tool: &ProgramTool, shape: &Shape, way: &Way) -> f64 {
        match EdgeEnds::of(tool, shape) {
            None => self.depth_of(shape, way),
            Some(ends) => {
                let covered = ends.covered(shape, way);
                covered.iter().map(|piece| self.depth(piece)).fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// Cuts along a way.
    pub(crate) fn cut_along(&mut self, shape: &Shape, way: &Way, owner: usize) {
        self.take_away(&shape.sweep(way), owner);
    }

    /// Cuts along straight ways that follow each other.
    pub(crate) fn cut_along_all(&mut self, shape: &Shape, ways: &[Way], owner: usize) {
        match shape.sweep_all(ways) {
            Some(swept) => self.take_away(&swept, owner),
            None => ways.iter().for_each(|way| self.cut_along(shape, way, owner)),
        }
    }

    fn take_away(&mut self, swept: &Swept, owner: usize) {
        let mut above = Vec::with_capacity(swept.pieces.len());
        swept.pieces.iter().for_each(|piece| above_axis(piece, &mut above));
        self.cut(&above, owner);
        for &[x, from] in &swept.walls {
            self.touch_wall(x, from, owner);
        }
    }
}

/// Adds a piece where it is above the axis, and the axis where it is below.
fn above_axis(piece: &Piece, into: &mut Vec<Piece>) {
    if piece.lowest(piece.x0, piece.x1) >= 0.0 {
        return into.push(*piece);
    }
    let axis = Curve::Line { x: 0.0, r: 0.0, slope: 0.0 };
    let mut at = vec![piece.x0, piece.x1];
    at.extend(piece.curve.crossings(axis, 0.0, [piece.x0, piece.x1]));
    at.sort_by(f64::total_cmp);
    for ends in at.windows(2) {
        let is_above = piece.curve.at(0.5 * (ends[0] + ends[1])) >= 0.0;
        into.push(Piece { x0: ends[0], x1: ends[1], curve: if is_above { piece.curve } else { axis } });
    }
}
