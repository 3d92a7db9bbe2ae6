//! Held work that is not the shaft of a drawing: what a program has left of it so far, under the tool that makes more of it.
//!
//! Beam, supports, effects, and what loads do to the gap are those of a job of this calculator; only its sections and its
//! forces come from elsewhere, move by move.

use crate::calculator::{Failure, Violations};
use crate::diameters::Draw;
use crate::force::{DepthLaw, ForceModel};

use crate::deflection_compensation::job::acting::{Acting, Passage};
use crate::deflection_compensation::job::check::check_effects;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{
    Cut, Detail, FeedDirection, Include, IncludeMode, Job, Section, Segment, SpeedDiameter, Stations,
};
use crate::deflection_compensation::job::structure::{Structure, Variant};
use crate::deflection_compensation::model::equilibrium::Opening;
use crate::deflection_compensation::model::laws::{Loads, law_at};
use crate::deflection_compensation::model::regime::{Regime, Speed};
use crate::deflection_compensation::model::yielding::{Ingredients, Line, Radii, couple_sign, wanted};

/// What holds work, what yields with it, and how the tool pushes.
#[derive(Debug, Clone)]
pub(crate) struct Holding {
    pub(crate) shaft: crate::deflection_compensation::job::input::Shaft,
    pub(crate) supports: Vec<crate::deflection_compensation::job::input::Support>,
    pub(crate) carriage: crate::deflection_compensation::job::input::Carriage,
    pub(crate) force: ForceModel,
    /// Whether the main force, the couple of the feed force and the weight act.
    pub(crate) tangential: bool,
    pub(crate) axial_moment: bool,
    pub(crate) weight: bool,
    pub(crate) gravity: crate::deflection_compensation::job::input::Gravity,
    pub(crate) effects: Vec<crate::effects::DeflectionEffect>,
    pub(crate) conditions: crate::effects::DeflectionConditions,
    /// How it differs from what is stated; what holds it differs already.
    pub(crate) draw: Draw,
}

/// A stretch of the work, from the headstock end on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names)] // the unit
pub(crate) struct Slice {
    pub(crate) length_mm: f64,
    /// Diameter until the tool has passed.
    pub(crate) ahead_mm: f64,
    /// Diameter from then on.
    pub(crate) behind_mm: f64,
    pub(crate) bore_mm: f64,
}

/// A place of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ToolPlace {
    pub(crate) z_mm: f64,
    pub(crate) radius_mm: f64,
    /// Path and time in the cut before it.
    pub(crate) path_m: f64,
    pub(crate) time_min: f64,
    /// What a formula of the user may ask for; 0 where none does.
    pub(crate) planned: Planned,
}

/// What is planned at a place of the tool.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Planned {
    pub(crate) depth_mm: f64,
    pub(crate) feed_mm_per_rev: f64,
    pub(crate) speed_m_per_min: f64,
}

/// What the tool does to the work, N.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(clippy::struct_field_names)] // the unit
pub(crate) struct Push {
    /// Radially, away from the tool.
    pub(crate) radial_n: f64,
    /// Along the cutting speed.
    pub(crate) main_n: f64,
    /// Along the axis, toward the tailstock.
    pub(crate) axial_n: f64,
}

/// Work that is held while the tool makes a move.
pub(crate) struct Held {
    draw: Draw,
    job: Job,
    acting: Acting,
    structure: Structure,
    direction: FeedDirection,
    length_mm: f64,
}

/// How the gap opens at places of the tool.
pub(crate) struct Gaps {
    line: Line,
    direction: FeedDirection,
    /// Where a place stands among those of the line, which ascend.
    index: Vec<usize>,
}

impl Holding {
    /// Rules for supports, force law and effects, as a job of this calculator has them.
    pub(crate) fn check(&self, violations: &mut Violations) {
        let job = self.work();
        crate::shaft::check::supports(&job.shaft, &job.supports, violations);
        job.force.check("/force", violations);
        check_effects(&job, violations);
    }

    /// The held work as a job of this calculator, which has no cut.
    pub(crate) fn work(&self) -> Job {
        self.job(self.shaft.segments.clone(), self.supports.clone(), FeedDirection::ToHeadstock)
    }

    fn job(
        &self,
        segments: Vec<Segment>,
        supports: Vec<crate::deflection_compensation::job::input::Support>,
        feed_direction: FeedDirection,
    ) -> Job {
        let mut shaft = self.shaft.clone();
        shaft.segments = segments;
        shaft.section = Some(Section::Mixed);
        let cut = Cut {
            feed_mm_per_rev: 1.0,
            speed_m_per_min: Some(1.0),
            spindle_speed_rpm: None,
            speed_diameter: SpeedDiameter::Stock,
            feed_direction,
        };
        let include = Include {
            mode: IncludeMode::AsStated,
            tangential: Some(self.tangential),
            axial_moment: Some(self.axial_moment),
            weight: self.weight,
        };
        Job {
            shaft,
            supports,
            carriage: self.carriage.clone(),
            force: self.force.clone(),
            cut,
            include,
            gravity: self.gravity.clone(),
            stations: Stations::List { z_mm: Vec::new() },
            stock_profile: None,
            passes: Vec::new(),
            detail: Detail::Profile,
            tolerance: crate::diameters::Tolerance::default(),
            aim: crate::diameters::Aim::default(),
            uncertainty: crate::diameters::Uncertainty::default(),
            path: crate::deflection_compensation::job::input::PathSettings::default(),
            program: crate::deflection_compensation::job::input::ProgramSettings::default(),
            limits: crate::deflection_compensation::job::input::Limits::default(),
            tailstock_thrust_n: None,
            compare_one_step: false,
            effects: self.effects.clone(),
            conditions: self.conditions.clone(),
        }
    }

    /// The same, not quite as it is stated.
    pub(crate) fn drawn(&self, draw: &Draw) -> Self {
        let mut drawn = Self { draw: Draw { effects: None, ..draw.clone() }, ..self.clone() };
        if let Some(effects) = &draw.effects {
            drawn.effects.clone_from(effects);
        }
        draw.yield_in(&mut drawn.supports, &mut drawn.carriage);
        drawn
    }

    /// Whether these of the supports hold the work.
    pub(crate) fn is_held_by(&self, acts: &[bool]) -> bool {
        let acting = || self.supports.iter().zip(acts).filter(|(_, acts)| **acts).map(|(support, _)| support);
        acting().any(|support| matches!(support, crate::deflection_compensation::job::input::Support::Chuck { .. }))
            || acting().filter(|support| support.carries()).count() >= 2
    }

    /// The work of these slices, held by those of the supports that act.
    pub(crate) fn hold(&self, slices: &[Slice], acts: &[bool], direction: FeedDirection) -> Result<Held, Failure> {
        let segment = |slice: &Slice| Segment {
            length_mm: slice.length_mm,
            diameter_mm: slice.behind_mm,
            stock_diameter_mm: Some(slice.ahead_mm),
            bore_diameter_mm: slice.bore_mm,
        };
        let supports = self.supports.iter().zip(acts).filter(|(_, acts)| **acts).map(|(support, _)| support.clone());
        let job = self.job(slices.iter().map(segment).collect(), supports.collect(), direction);
        let mut acting = Acting::of(&job.effects, &job.conditions, direction);
        acting.structure.flexibility /= self.draw.youngs_modulus;
        // What is not there yet is not set off.
        if acts.contains(&false) {
            acting.set_off.clear();
        }
        let mut variant = Variant::of(&job, &acting.structure);
        variant.section = Section::Mixed;
        let structure = Structure::of(&job, &variant)?;
        let length_mm = slices.iter().map(|slice| slice.length_mm).sum();
        Ok(Held { draw: self.draw.clone(), job, acting, structure, direction, length_mm })
    }
}

impl Held {
    /// How the gap opens with the tool at these places.
    pub(crate) fn gaps(&self, places: &[ToolPlace]) -> Result<Gaps, Failure> {
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by(|&a, &b| places[a].z_mm.total_cmp(&places[b].z_mm));
        let mut index = vec![0; places.len()];
        for (at, &place) in order.iter().enumerate() {
            index[place] = at;
        }
        let z_mm: Vec<f64> = order.iter().map(|&i| places[i].z_mm.clamp(0.0, self.length_mm)).collect();
        let radii: Vec<f64> = order.iter().map(|&i| places[i].radius_mm).collect();
        let passage = |&i: &usize| Passage {
            z_mm: places[i].z_mm,
            u: places[i].z_mm / self.length_mm,
            diameter_mm: 2.0 * places[i].radius_mm,
            path_m: places[i].path_m,
            time_min: places[i].time_min,
            depth_mm: places[i].planned.depth_mm,
            feed_mm_per_rev: places[i].planned.feed_mm_per_rev,
            speed_m_per_min: places[i].planned.speed_m_per_min,
        };
        let passages: Vec<Passage> =
            if self.acting.has_errors() { order.iter().map(passage).collect() } else { Vec::new() };
        let displaced = self.structure.displaced(&self.job, &self.acting.set_off, &z_mm)?;
        let profile = self.structure.beam.profile(&z_mm, wanted(&self.job));
        let grid = Grid {
            segment: vec![0; z_mm.len()],
            zones: Vec::new(),
            length_mm: self.length_mm,
            steps_mm: vec![0.0, self.length_mm],
            z_mm,
        };
        let regime = Regime {
            feed_mm_per_rev: 1.0,
            speed: Speed::Surface(1.0),
            speed_diameter: SpeedDiameter::Stock,
            direction: self.direction,
        };
        let radii = Radii { target: radii.clone(), stock: radii, planned: None, idle: Vec::new() };
        let ingredients = Ingredients {
            job: &self.job,
            grid: &grid,
            acting: &self.acting,
            structure: &self.structure,
            regime: &regime,
            radii: &radii,
            passages: &passages,
            displaced: displaced.as_ref(),
        };
        let mut line = Line::of(&ingredients, profile);
        let [_, weight] = self.draw.loads();
        if self.draw != Draw::STATED {
            line.widen_gaps(self.draw.rest_gap_mm);
            line = line.under(1.0, weight);
        }
        self.acting.values(&line, &passages)?;
        Ok(Gaps { line, direction: self.direction, index })
    }

    /// Whether a formula of the user asks for what is planned.
    pub(crate) fn has_formulas(&self) -> bool {
        self.acting.has_formulas()
    }

    /// Whether an effect makes the force depend on the cutting speed.
    pub(crate) fn depends_on_speed(&self) -> bool {
        self.acting.force.depends_on_speed()
    }

    /// Whether the effects change the force by one factor all along the work.
    pub(crate) fn is_same_everywhere(&self) -> bool {
        self.acting.force.same_everywhere()
    }

    /// Forces over the depth at a place, with the effects in them.
    pub(crate) fn law(&self, force: &ForceModel, z_mm: f64, feed_mm_per_rev: f64, speed_m_per_min: f64) -> DepthLaw {
        let change = &self.acting.force;
        let factor = change.factor(z_mm / self.length_mm, feed_mm_per_rev, speed_m_per_min);
        let law = law_at(force, feed_mm_per_rev, speed_m_per_min, factor, change);
        let [load, _] = self.draw.loads();
        if self.draw == Draw::STATED { law } else { law.scaled(load) }
    }
}

impl Gaps {
    /// Compliance at the tool, carriage included, mm/N.
    pub(crate) fn compliance_mm_per_n(&self, place: usize) -> f64 {
        self.line.compliance_mm_per_n(self.index[place])
    }

    /// Opening of the gap at one of the places.
    pub(crate) fn opening(&self, place: usize, push: Push) -> Opening {
        // The feed force of the line pushes along the feed.
        let feed_n = couple_sign(self.direction) * push.axial_n;
        let loads = Loads { passive_n: push.radial_n, main_n: push.main_n, feed_n, ..Loads::default() };
        self.line.opening(self.index[place], &loads)
    }
}
