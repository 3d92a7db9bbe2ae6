//! Fields of a tool.

use super::field::{Field, Form, GROUPS, NOTE, Quantity, ROW_NOTE, TAGS, TITLE, count, field, needed, quantity};

const LENGTH: Quantity = quantity("mm", "l", (0.01, 10_000.0), 25.0);

/// Names of ISO 13399 that stand for fields of ours on input.
pub const ISO_13399: &[(&str, &str)] = &[
    ("RE", "nose_radius_mm"),
    ("KAPR", "cutting_edge_angle_deg"),
    ("IC", "inscribed_circle_mm"),
    ("S", "thickness_mm"),
    ("AN", "clearance_angle_deg"),
    ("LE", "cutting_edge_length_mm"),
    ("DC", "diameter_mm"),
    ("ZEFP", "teeth"),
    ("FHA", "helix_angle_deg"),
    ("APMX", "depth_max_mm"),
    ("CEDC", "edges_per_insert"),
    ("H", "shank_height_mm"),
    ("B", "shank_width_mm"),
    ("LF", "functional_length_mm"),
    ("DCONMS", "shank_diameter_mm"),
    ("DMIN", "bore_min_mm"),
    ("GAMO", "rake_angle_deg"),
    ("LAMS", "inclination_angle_deg"),
];

const fn angle(symbol: &'static str, ends: (f64, f64), example: f64) -> Form {
    Form::Number(quantity("deg", symbol, ends, example))
}

const BAR: &[Field] = &[
    field(
        "youngs_modulus_n_per_mm2",
        Form::Number(quantity("N/mm2", "E", (1000.0, 2_000_000.0), 210_000.0)),
        "Modulus of elasticity of the bar.",
    ),
    field(
        "overhang_over_diameter_max",
        Form::Number(quantity("1", "L/D", (0.1, 50.0), 4.0)),
        "Longest overhang, in diameters.",
    ),
    field("diameter_mm", Form::Number(LENGTH), "Diameter, where no code says it."),
    field("overhang_mm", Form::Number(LENGTH), "Overhang as it is held."),
];

const RECOMMENDED: &[Field] = &[
    needed("cut", Form::Word(&["finish", "medium", "rough", "small_parts"]), "Kind of the cut."),
    needed("iso513_group", Form::Word(GROUPS), "Group of the material."),
    field("depth_low_mm", Form::Plain(quantity("mm", "t", (0.0001, 1000.0), 0.5)), "Least depth of cut."),
    field("depth_high_mm", Form::Plain(quantity("mm", "t", (0.0001, 1000.0), 4.0)), "Largest depth of cut."),
    field("feed_low_mm_per_rev", Form::Plain(quantity("mm/rev", "s", (0.0001, 20.0), 0.2)), "Least feed."),
    field("feed_high_mm_per_rev", Form::Plain(quantity("mm/rev", "s", (0.0001, 20.0), 0.5)), "Largest feed."),
    ROW_NOTE,
];

/// What a tool may be.
pub(crate) const KINDS: &[&str] = &["turning_external", "boring_bar", "milling_indexable", "milling_solid"];

pub(super) const FIELDS: &[Field] = &[
    TITLE,
    needed("kind", Form::Word(KINDS), "What it is."),
    field("insert", Form::Text(64), "Designation of the insert, ISO 1832."),
    field("holder", Form::Text(64), "Designation of the holder, ISO 5608, of a bar, ISO 6261."),
    field("nose_radius_mm", Form::Number(quantity("mm", "r", (0.0, 50.0), 0.8)), "Nose radius."),
    field("cutting_edge_angle_deg", angle("kappa", (1.0, 179.0), 95.0), "Angle of the main edge to the feed."),
    field("minor_edge_angle_deg", angle("kappa'", (0.0, 179.0), 5.0), "Angle of the minor edge to the feed."),
    field("clearance_angle_deg", angle("alpha", (0.0, 60.0), 7.0), "Clearance angle."),
    field("rake_angle_deg", angle("gamma", (-60.0, 60.0), 6.0), "Rake angle."),
    field("inclination_angle_deg", angle("lambda", (-60.0, 60.0), -6.0), "Inclination of the main edge."),
    field("included_angle_deg", angle("epsilon", (10.0, 170.0), 80.0), "Angle between main and minor edge."),
    field("inscribed_circle_mm", Form::Number(LENGTH), "Inscribed circle of the insert."),
    field("thickness_mm", Form::Number(LENGTH), "Thickness of the insert."),
    field("cutting_edge_length_mm", Form::Number(LENGTH), "Length of an edge of the insert."),
    field("shank_height_mm", Form::Number(LENGTH), "Height of the shank."),
    field("shank_width_mm", Form::Number(LENGTH), "Width of the shank."),
    field("functional_length_mm", Form::Number(LENGTH), "Length from the gauge plane to the edge."),
    field("shank_diameter_mm", Form::Number(LENGTH), "Diameter of a round shank."),
    field("bore_min_mm", Form::Number(LENGTH), "Least bore that a bar goes into."),
    field("bar", Form::Group(BAR), "The bar of a boring tool."),
    field("iso513_grade", Form::SourcedWord(&[]), "Grade by ISO 513, as P25; or HSS."),
    field("speed_tool", Form::Text(64), "Word by which `cutting_speeds` of a material call this tool: `coated_cvd_p`."),
    field("tool_life", Form::Model, "Tool life as a model of feed schedules."),
    field("recommended", Form::Rows(RECOMMENDED, 200), "Depths and feeds that its maker recommends."),
    field(
        "edges_per_insert",
        Form::Number(count("n_e", (1.0, 100.0), 4.0)),
        "Edges that can be used, one after another.",
    ),
    field("insert_price_money", Form::Number(quantity("money", "k_i", (0.0, 1e9), 9.0)), "Price of an insert."),
    field("price_money", Form::Number(quantity("money", "k", (0.0, 1e9), 60.0)), "Price of a solid cutter."),
    field("diameter_mm", Form::Number(quantity("mm", "D", (0.1, 5000.0), 50.0)), "Diameter of a cutter."),
    field("teeth", Form::Number(count("z", (1.0, 200.0), 4.0)), "Teeth of a cutter."),
    field("helix_angle_deg", angle("beta", (-80.0, 80.0), 30.0), "Helix angle of a cutter."),
    field("depth_max_mm", Form::Number(LENGTH), "Deepest cut."),
    NOTE,
    TAGS,
];
