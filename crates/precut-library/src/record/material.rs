//! Fields of a material.

use super::field::{
    Field, Form, GROUPS, HOLDS_FOR, NOTE, Quantity, ROW_NOTE, TAGS, TITLE, count, field, needed, quantity,
};

const STRENGTH: Quantity = quantity("N/mm2", "sigma", (1.0, 10_000.0), 600.0);
const EXPONENT: Quantity = quantity("1", "x", (0.0, 2.0), 0.2);
const FEED: Quantity = quantity("mm/rev", "s", (0.0001, 20.0), 0.3);
const SPEED: Quantity = quantity("m/min", "v", (0.01, 20_000.0), 150.0);
const RATIO: Quantity = quantity("1", "f_z/D", (0.0, 1.0), 0.005);

/// Names by standard.
const NAMES: &[Field] = &[
    field("en", Form::Texts(64), "EN."),
    field("en_number", Form::Texts(64), "Number of EN 10027-2."),
    field("din", Form::Texts(64), "DIN."),
    field("aisi", Form::Texts(64), "AISI, SAE, ASTM."),
    field("uns", Form::Texts(64), "UNS."),
    field("gost", Form::Texts(64), "GOST, in Latin letters."),
    field("jis", Form::Texts(64), "JIS."),
    field("gb", Form::Texts(64), "GB."),
    field("other", Form::Texts(64), "Others: makers, houses."),
];

const KIENZLE: &[Field] = &[
    needed(
        "specific_cutting_force_n_per_mm2",
        Form::Plain(quantity("N/mm2", "k_c1.1", (50.0, 20_000.0), 2100.0)),
        "Specific cutting force at 1 mm chip thickness.",
    ),
    field("cutting_exponent", Form::Plain(quantity("1", "m_c", (0.0, 0.9), 0.25)), "Exponent of the chip thickness."),
    field(
        "specific_normal_force_n_per_mm2",
        Form::Plain(quantity("N/mm2", "k_n1.1", (50.0, 20_000.0), 900.0)),
        "Specific force normal to the edge, where it was measured; no table gives it.",
    ),
    field("normal_exponent", Form::Plain(quantity("1", "m_n", (0.0, 0.9), 0.35)), "Exponent of the normal force."),
    field(
        "use",
        Form::Word(&["preferred", "alternative", "incomplete"]),
        "Whether it is taken where a job does not say.",
    ),
    field("holds_for", Form::Word(HOLDS_FOR), "For what it was stated."),
    field("family", Form::Text(64), "Rows of one family are copies of one measurement and count once."),
    field("superseded_by", Form::Text(64), "Source of a newer edition."),
    field("base_rake_deg", Form::Plain(quantity("deg", "gamma_0", (-30.0, 40.0), 6.0)), "Rake at which it holds."),
    field(
        "rake_slope_percent_per_deg",
        Form::Plain(quantity("percent/deg", "q", (0.0, 5.0), 1.0)),
        "How much less a degree more of rake makes it.",
    ),
    field(
        "fit_deviation_percent",
        Form::Plain(quantity("percent", "d", (0.0, 100.0), 2.0)),
        "Largest deviation of the fit.",
    ),
    field("class_name", Form::Text(200), "How the source calls the class."),
    ROW_NOTE,
];

const TAYLOR: &[Field] = &[
    needed("form", Form::Word(&["taylor", "handbook"]), "V T^n = C, or V = C t^-x s^-y T^-m."),
    needed("tool", Form::Text(64), "Cutting material."),
    field("coefficient", Form::Plain(quantity("m/min", "C_v", (0.1, 100_000.0), 350.0)), "C_v of the handbook's form."),
    field("depth_exponent", Form::Plain(EXPONENT), "x of the handbook's form."),
    field("feed_exponent", Form::Plain(EXPONENT), "y of the handbook's form."),
    needed("life_exponent", Form::Plain(quantity("1", "m", (0.01, 2.0), 0.2)), "m, or n of Taylor's form."),
    field("feed_above_mm_per_rev", Form::Plain(FEED), "The row begins above this feed."),
    field("feed_up_to_mm_per_rev", Form::Plain(FEED), "The row ends with this feed."),
    field(
        "speed_at_one_minute_m_per_min",
        Form::Plain(quantity("m/min", "C", (0.1, 100_000.0), 500.0)),
        "C of Taylor's form: the speed at which an edge lasts a minute.",
    ),
    field("at_feed_mm_per_rev", Form::Plain(FEED), "Feed of the trials behind Taylor's form."),
    field("at_depth_mm", Form::Plain(quantity("mm", "t", (0.0001, 1000.0), 2.5)), "Their depth of cut."),
    field("flank_wear_mm", Form::Plain(quantity("mm", "VB", (0.001, 5.0), 0.3)), "Wear at which an edge was worn."),
    field("scatter_of_log_life", Form::Plain(quantity("1", "s", (0.0, 5.0), 0.2)), "Standard deviation of ln T."),
    field("trials", Form::Plain(count("n", (1.0, 1e6), 3.0)), "Trials."),
    field("holds_for", Form::Word(HOLDS_FOR), "For what it was stated."),
    ROW_NOTE,
];

const SPEEDS: &[Field] = &[
    needed("operation", Form::Word(&["turning", "milling"]), "Operation."),
    needed("cut", Form::Word(&["general", "finish", "medium", "rough"]), "Kind of the cut."),
    needed("tool", Form::Text(64), "Cutting material."),
    needed("low_m_per_min", Form::Plain(SPEED), "Least recommended speed."),
    needed("high_m_per_min", Form::Plain(SPEED), "Largest recommended speed."),
    field("feed_per_tooth_over_diameter_low", Form::Plain(RATIO), "Least feed per tooth over the cutter's diameter."),
    field("feed_per_tooth_over_diameter_high", Form::Plain(RATIO), "Largest feed per tooth over the diameter."),
    field("holds_for", Form::Word(HOLDS_FOR), "For what it was stated."),
    ROW_NOTE,
];

const SEEN: &[Field] =
    &[needed("name", Form::Text(64), "The name."), field("source", Form::Text(300), "Where it was read.")];

/// Classes of the handbook's power laws.
const CLASSES: &[&str] = &[
    "steel",
    "stainless_12kh18n9t",
    "grey_iron",
    "malleable_iron",
    "copper_multiphase",
    "copper_multiphase_hard",
    "copper_leaded_multiphase",
    "copper_single_phase",
    "copper",
    "copper_high_lead",
    "aluminium",
    "duralumin_250",
    "duralumin_350",
    "duralumin_above_350",
];

pub(super) const FIELDS: &[Field] = &[
    TITLE,
    field("iso513_group", Form::Word(GROUPS), "Group of ISO 513."),
    field("vdi3323_group", Form::Number(count("group", (1.0, 41.0), 4.0)), "Group of VDI 3323."),
    field("condition", Form::Text(200), "Heat treatment."),
    field("variant_of", Form::Text(64), "Material of which it is another condition."),
    field("names", Form::Group(NAMES), "Names by standard."),
    field("names_source", Form::Text(300), "Where the names are from."),
    field("names_certainty", Form::Word(super::view::CERTAINTIES), "How certain the names are."),
    field("names_seen", Form::List(SEEN, 200), "Names that were read in a source."),
    field(
        "youngs_modulus_n_per_mm2",
        Form::Number(quantity("N/mm2", "E", (1000.0, 2_000_000.0), 210_000.0)),
        "Modulus of elasticity.",
    ),
    field("poisson_ratio", Form::Number(quantity("1", "nu", (0.0, 0.499), 0.3)), "Poisson's ratio."),
    field("density_kg_per_m3", Form::Number(quantity("kg/m3", "rho", (1.0, 30_000.0), 7850.0)), "Density."),
    field("yield_strength_n_per_mm2", Form::Number(STRENGTH), "Yield strength or 0.2 % proof stress."),
    field("tensile_strength_n_per_mm2", Form::Number(STRENGTH), "Tensile strength."),
    field("group_tensile_strength_n_per_mm2", Form::Number(STRENGTH), "Tensile strength of its VDI 3323 group."),
    field("brinell_hardness", Form::Number(quantity("1", "HB", (10.0, 800.0), 190.0)), "Brinell hardness."),
    field("group_brinell_hardness", Form::Number(quantity("1", "HB", (10.0, 800.0), 190.0)), "That of its group."),
    field("rockwell_c_hardness", Form::Number(quantity("1", "HRC", (5.0, 75.0), 55.0)), "Rockwell hardness C."),
    field("kienzle", Form::Rows(KIENZLE, 50), "Constants of Kienzle's law, one row a source."),
    field("work_material", Form::Word(CLASSES), "Class in the handbook of the power laws."),
    field("taylor", Form::Rows(TAYLOR, 200), "Tool life, one row a source, tool and range."),
    field("cutting_speeds", Form::Rows(SPEEDS, 500), "Recommended cutting speeds."),
    NOTE,
    TAGS,
];
