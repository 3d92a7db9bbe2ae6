//! How the workpiece is held: contacts with friction, where the cut pushes, and what that means to the kernel of clamping.

use serde::{Deserialize, Serialize};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::clamping::{Contact, Fixture, Rest, Unheld, Vector, Vise};
use crate::fixture_stability::{Friction, FrictionRange};

use super::input::{DirectionPart, number};

/// Standard gravity, m/s2.
const GRAVITY: f64 = 9.806_65;
/// Places nearer than this are one.
const SAME_PLACE_MM: f64 = 1e-6;
/// Cosine to an axis across below which a feed lies along the other one.
const ALONG_AN_AXIS: f64 = 1e-9;

/// How the workpiece is held, in the axes of the fixture, and where the cut pushes it: by a vise, or by contacts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PartClamping {
    /// Two flat jaws that press along Y, their length along X; the bottom of the workpiece is Z = 0, its middle X = Y = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vise: Option<GrippingVise>,
    /// Contacts anywhere, in place of a vise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contacts: Option<GrippingContacts>,
    /// Where the cut acts on the workpiece.
    #[schema(min_items = 3, max_items = 3, example = json!([0.0, 0.0, 40.0]))]
    pub cut_point_mm: Vec<Coordinate>,
    /// Further places along the path at which the same cut acts; left out, both ends and the middle of the way that leads along the feed
    /// through the place of the cut over the workpiece between its jaws or contacts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8)]
    pub stations: Vec<CutStation>,
    /// Mass of the workpiece; it weighs along -Z.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 1.2, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m"))))]
    pub part_mass_kg: f64,
    /// Where its weight acts.
    #[serde(default = "origin")]
    #[schema(min_items = 3, max_items = 3, default = json!([0.0, 0.0, 0.0]), example = json!([0.0, 0.0, 20.0]))]
    pub centre_of_mass_mm: Vec<Coordinate>,
    /// Factor on all forces of the cut.
    #[serde(default = "once")]
    #[schema(minimum = 1.0, maximum = 10.0, default = 1.0, example = 1.5, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("S"))))]
    pub safety: f64,
}

fn origin() -> Vec<Coordinate> {
    vec![Coordinate(0.0); 3]
}

fn once() -> f64 {
    1.0
}

number!(Coordinate, "A coordinate along an axis of the fixture.", "mm", "p", -100_000.0, 100_000.0, 40.0);

/// A place at which the cut acts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CutStation {
    /// Along X of the fixture.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 35.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("X"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Y"))))]
    pub y_mm: f64,
    /// Along Z, up.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 40.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Z"))))]
    pub z_mm: f64,
}

/// Two flat jaws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GrippingVise {
    /// Length of the jaws that touches the workpiece.
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a"))))]
    pub jaw_length_mm: f64,
    /// Height that they grip, from the bottom of the workpiece.
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 30.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("b"))))]
    pub jaw_height_mm: f64,
    /// Width of the workpiece between them.
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 60.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("w"))))]
    pub part_width_mm: f64,
    /// Whether the workpiece rests on parallels.
    #[serde(default = "yes")]
    #[schema(default = true, example = true)]
    pub parallels: bool,
    /// Whether a cylinder presses the movable jaw, whose force then stays as it is; else a screw does.
    #[serde(default)]
    #[schema(default = false, example = false)]
    pub constant_force: bool,
    /// Friction at jaws and parallels.
    #[serde(default)]
    pub friction: Friction,
    /// Clamp force at hand; without it the force that is needed is told alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 5400.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F")), ("x-code" = json!("bad_clamp_force"))))]
    pub clamp_force_n: Option<f64>,
}

fn yes() -> bool {
    true
}

/// Contacts between fixture and workpiece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GrippingContacts {
    /// Clamps and locators; a face is at least its corners.
    #[schema(min_items = 1, max_items = 24)]
    pub points: Vec<GrippingPoint>,
    /// Friction where a contact states none.
    #[serde(default)]
    pub friction: Friction,
    /// Clamp force at hand; without it the force that is needed is told alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 5400.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F")), ("x-code" = json!("bad_clamp_force"))))]
    pub clamp_force_n: Option<f64>,
}

/// A contact between fixture and workpiece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GrippingPoint {
    /// Where.
    #[schema(min_items = 3, max_items = 3, example = json!([50.0, 30.0, 0.0]))]
    pub position_mm: Vec<Coordinate>,
    /// Direction into the workpiece; its length does not matter.
    #[schema(min_items = 3, max_items = 3, example = json!([0.0, -1.0, 0.0]))]
    pub normal: Vec<DirectionPart>,
    /// Stiffness along the normal. Of all contacts alike it drops out.
    #[serde(default = "along_n_per_mm")]
    #[schema(minimum = 1e-3, maximum = 1e12, default = 40_000.0, example = 40_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_n"))))]
    pub normal_stiffness_n_per_mm: f64,
    /// Stiffness across it.
    #[serde(default = "across_n_per_mm")]
    #[schema(minimum = 1e-3, maximum = 1e12, default = 28_000.0, example = 28_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_t"))))]
    pub tangential_stiffness_n_per_mm: f64,
    /// Share of the clamp force that a clamp presses with here; 0 for a locator.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c"))))]
    pub clamp_share: f64,
    /// Whether a cylinder presses, whose force then stays as it is; else a screw does.
    #[serde(default)]
    #[schema(default = false, example = false)]
    pub constant_force: bool,
    /// Friction here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
}

fn along_n_per_mm() -> f64 {
    40_000.0
}

fn across_n_per_mm() -> f64 {
    28_000.0
}

/// A clamped workpiece as the kernel takes it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::milling_stability) struct Held {
    pub fixture: Fixture,
    pub rest: Rest,
    /// Lowest, likely and highest, contact by contact.
    pub friction: [Vec<f64>; 3],
    /// Where the cut acts.
    pub points_mm: Vec<Vector>,
    /// Whether the job states no place but the first.
    pub is_way_assumed: bool,
    pub safety: f64,
    pub clamp_force_n: Option<f64>,
}

impl PartClamping {
    /// What is known of each friction, with where it stands.
    pub(in crate::milling_stability) fn frictions(&self) -> Vec<(String, Friction)> {
        let of_vise = self.vise.iter().map(|vise| ("/clamping/vise/friction".to_owned(), vise.friction));
        let of_contacts = self.contacts.iter().flat_map(|of| {
            let own =
                of.points.iter().enumerate().filter_map(|(i, point)| {
                    Some((format!("/clamping/contacts/points/{i}/friction"), point.friction?))
                });
            std::iter::once(("/clamping/contacts/friction".to_owned(), of.friction)).chain(own)
        });
        of_vise.chain(of_contacts).collect()
    }

    /// The clamp force at hand, with where it stands.
    pub(in crate::milling_stability) fn clamp_force(&self) -> Option<(f64, &'static str)> {
        let of_vise = self.vise.as_ref().and_then(|vise| Some((vise.clamp_force_n?, "/clamping/vise/clamp_force_n")));
        let of_contacts = || Some((self.contacts.as_ref()?.clamp_force_n?, "/clamping/contacts/clamp_force_n"));
        of_vise.or_else(of_contacts)
    }

    /// Whether a cylinder presses at every clamp, else a hand turns a screw.
    pub(super) fn is_set_by_pressure(&self) -> bool {
        let mut clamps = self.contacts.iter().flat_map(|of| &of.points).filter(|point| point.clamp_share > 0.0);
        self.vise.as_ref().map_or_else(|| clamps.all(|point| point.constant_force), |vise| vise.constant_force)
    }

    /// Contacts and weight; `None` of a job that is refused.
    fn fixture(&self) -> Option<Fixture> {
        let weight_n = GRAVITY * self.part_mass_kg;
        let centre_of_mass_mm = vector(&self.centre_of_mass_mm)?;
        match (&self.vise, &self.contacts) {
            (Some(of), None) => Some(
                Vise {
                    jaw_length_mm: of.jaw_length_mm,
                    jaw_height_mm: of.jaw_height_mm,
                    part_width_mm: of.part_width_mm,
                    parallels: of.parallels,
                    friction: of.friction.range().low,
                    constant_force: of.constant_force,
                    weight_n,
                    centre_of_mass_mm,
                }
                .fixture(),
            ),
            (None, Some(of)) => {
                let contacts = of.points.iter().map(|point| point.contact(of.friction)).collect::<Option<Vec<_>>>()?;
                Some(Fixture { contacts, weight_n, centre_of_mass_mm })
            }
            _ => None,
        }
    }

    /// Where the cut acts: as stated, else along the feed.
    pub(in crate::milling_stability) fn places_mm(&self, feed_direction_deg: f64) -> Option<Vec<Vector>> {
        let cut_mm = vector(&self.cut_point_mm)?;
        let stated = self.stations.iter().map(|at| [at.x_mm, at.y_mm, at.z_mm]);
        let further = if self.stations.is_empty() { self.way_mm(cut_mm, feed_direction_deg) } else { stated.collect() };
        let mut places = vec![cut_mm];
        for place in further {
            let is_there = |known: &Vector| (0..3).all(|q| (known[q] - place[q]).abs() < SAME_PLACE_MM);
            if !places.iter().any(is_there) {
                places.push(place);
            }
        }
        Some(places)
    }

    /// Both ends and the middle of the way along the feed through the place of the cut, as far as the workpiece reaches for
    /// certain: between the jaws over their length, or between the outermost contacts.
    fn way_mm(&self, cut_mm: Vector, feed_direction_deg: f64) -> Vec<Vector> {
        let (sin, cos) = feed_direction_deg.to_radians().sin_cos();
        let Some(reach) = self.reach_mm() else { return Vec::new() };
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for (q, along) in [cos, sin].into_iter().enumerate() {
            let [low, high] = reach[q].map(|end| end - cut_mm[q]);
            if along.abs() < ALONG_AN_AXIS {
                if low > 0.0 || high < 0.0 {
                    return Vec::new();
                }
                continue;
            }
            from = from.max((low / along).min(high / along));
            to = to.min((low / along).max(high / along));
        }
        if from >= to {
            return Vec::new();
        }
        let at = |way: f64| [cut_mm[0] + way * cos, cut_mm[1] + way * sin, cut_mm[2]];
        vec![at(from), at(0.5 * (from + to)), at(to)]
    }

    /// From where to where the workpiece reaches at least along X and Y.
    fn reach_mm(&self) -> Option<[[f64; 2]; 2]> {
        if let Some(vise) = &self.vise {
            return Some([vise.jaw_length_mm, vise.part_width_mm].map(|length| [-0.5 * length, 0.5 * length]));
        }
        let places: Vec<Vector> =
            self.contacts.as_ref()?.points.iter().filter_map(|of| vector(&of.position_mm)).collect();
        let ends = |q: usize| {
            let along = places.iter().map(|place| place[q]);
            [along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max)]
        };
        Some([ends(0), ends(1)])
    }

    /// What the kernel takes, or why the part does not stand; `None` of a job that is refused for its fields.
    pub(in crate::milling_stability) fn held(&self, feed_direction_deg: f64) -> Option<Result<Held, Unheld>> {
        let fixture = self.fixture()?;
        let of = |pick: fn(&FrictionRange) -> f64| -> Vec<f64> {
            match (&self.vise, &self.contacts) {
                (Some(vise), _) => vec![pick(&vise.friction.range()); fixture.contacts.len()],
                (None, Some(of)) => {
                    of.points.iter().map(|point| pick(&point.friction.unwrap_or(of.friction).range())).collect()
                }
                (None, None) => Vec::new(),
            }
        };
        let friction = [of(|one| one.low), of(|one| one.value), of(|one| one.high)];
        let points_mm = self.places_mm(feed_direction_deg)?;
        let clamp_force_n = self.clamp_force().map(|(force_n, _)| force_n);
        Some(Rest::of(&fixture).map(|rest| Held {
            fixture,
            rest,
            friction,
            points_mm,
            is_way_assumed: self.stations.is_empty(),
            safety: self.safety,
            clamp_force_n,
        }))
    }
}

impl GrippingPoint {
    /// Of length 1.
    pub(in crate::milling_stability) fn direction(&self) -> Option<Vector> {
        super::case::unit(&self.normal)
    }

    fn contact(&self, usual: Friction) -> Option<Contact> {
        Some(Contact {
            position_mm: vector(&self.position_mm)?,
            normal: self.direction()?,
            friction: self.friction.unwrap_or(usual).range().low,
            normal_stiffness_n_per_mm: self.normal_stiffness_n_per_mm,
            tangential_stiffness_n_per_mm: self.tangential_stiffness_n_per_mm,
            clamp_share: self.clamp_share,
            constant_force: self.constant_force,
        })
    }
}

fn vector(of: &[Coordinate]) -> Option<Vector> {
    let [x, y, z] = of else { return None };
    Some([x.0, y.0, z.0])
}
