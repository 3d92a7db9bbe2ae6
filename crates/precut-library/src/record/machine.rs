//! Fields of a machine.

use super::field::{Field, Form, NOTE, Quantity, TAGS, TITLE, count, field, needed, quantity};

const COMPLIANCE: Quantity = quantity("um/N", "w", (0.0, 1000.0), 0.033);
const SPEED: Quantity = quantity("rev/min", "n", (0.001, 200_000.0), 2000.0);
const LENGTH: Quantity = quantity("mm", "L", (0.1, 200_000.0), 1000.0);

/// What a single stiffness means: `deflection-compensation`, section 5.
pub(crate) const MEANINGS: &[&str] = &["carriage_only", "three_springs", "midspan_equal", "midspan_1_2_1", "sum_equal"];

const COMPLIANCES: &[Field] = &[
    field("headstock_centre_um_per_n", Form::Number(COMPLIANCE), "Centre in the headstock, radially."),
    field("headstock_chuck_um_per_n", Form::Number(COMPLIANCE), "Chuck, radially."),
    field(
        "headstock_chuck_rotation_rad_per_n_mm",
        Form::Number(quantity("rad/(N mm)", "w_r", (0.0, 1.0), 8e-10)),
        "Chuck against rotation.",
    ),
    field("tailstock_centre_um_per_n", Form::Number(COMPLIANCE), "Centre in the tailstock, radially."),
    field("carriage_um_per_n", Form::Number(COMPLIANCE), "Carriage with tool post, radially."),
    field("carriage_tangential_um_per_n", Form::Number(COMPLIANCE), "Carriage along the cutting speed."),
    field("rests_um_per_n", Form::Named(COMPLIANCE), "Rests by name."),
    field("steady_rest_um_per_n", Form::Number(COMPLIANCE), "A rest without a name."),
    field("spindle_radial_um_per_n", Form::Number(COMPLIANCE), "Spindle of a mill with its tool, radially."),
    field(
        "single_stiffness_n_per_mm",
        Form::Number(quantity("N/mm", "j", (1.0, 1e9), 20_000.0)),
        "One stiffness of a static test, in place of the compliances that its meaning stands for.",
    ),
    field("meaning", Form::Word(MEANINGS), "What was loaded and read in the static test."),
];

const SPINDLE: &[Field] = &[
    field("speed_min_rpm", Form::Number(SPEED), "Least spindle speed."),
    field("speed_max_rpm", Form::Number(SPEED), "Largest spindle speed."),
    field(
        "efficiency",
        Form::Number(quantity("1", "eta", (0.01, 1.0), 0.8)),
        "Share of the motor's power that reaches the cut.",
    ),
    field(
        "characteristic",
        Form::Rows(
            &[
                needed(
                    "spindle_speed_rpm",
                    Form::Plain(quantity("rev/min", "n", (0.1, 200_000.0), 1500.0)),
                    "Spindle speed.",
                ),
                field("power_kw", Form::Plain(quantity("kW", "P_max", (1e-6, 10_000.0), 7.5)), "Power of the motor."),
                field("torque_n_m", Form::Plain(quantity("N m", "M_max", (1e-6, 1e7), 48.0)), "Torque at the spindle."),
            ],
            200,
        ),
        "Power and torque over the spindle speed, by rising speed, straight lines between.",
    ),
];

const TRAVEL: &[Field] = &[
    field("diameter_max_mm", Form::Number(LENGTH), "Largest diameter that turns over the bed or the carriage."),
    field("between_centres_mm", Form::Number(LENGTH), "Longest part."),
    field(
        "feed_rate_max_mm_per_min",
        Form::Number(quantity("mm/min", "v_f", (0.001, 1e6), 5000.0)),
        "Largest speed of the carriage or the table.",
    ),
    field("x_mm", Form::Number(LENGTH), "Travel of a mill along X."),
    field("y_mm", Form::Number(LENGTH), "Travel of a mill along Y."),
    field("z_mm", Form::Number(LENGTH), "Travel of a mill along Z."),
];

const CONTROL: &[Field] = &[
    field(
        "dialect",
        Form::SourcedWord(&["fanuc", "fanuc_a", "fanuc_c", "siemens", "linuxcnc"]),
        "How programs are spelled.",
    ),
    field(
        "increment_um",
        Form::Number(quantity("um", "increment", (0.001, 100.0), 1.0)),
        "Smallest step of the control: of X on the diameter, and of Z.",
    ),
    field("spindle_limit_rpm", Form::Number(SPEED), "Limit of the spindle with constant cutting speed."),
];

const PRICE: &[Field] = &[
    field("machine_rate_money_per_min", Form::Number(quantity("money", "k_m", (0.0, 1e9), 1.0)), "Money per minute."),
    field("tool_change_time_min", Form::Number(quantity("min", "t_c", (0.0, 1e6), 2.0)), "Time to change an edge."),
];

const HISTORY: &[Field] = &[
    needed("calculator", Form::Text(64), "Whose jobs the model extends."),
    needed("model", Form::Text(64), "Name of the model."),
    needed("revision", Form::Plain(count("revision", (1.0, 4e9), 1.0)), "Its revision."),
    field("from_date", Form::Text(10), "First day in force, as 2026-03-01."),
    field("to_date", Form::Text(10), "Last day in force."),
    field("note", Form::Text(1000), "Why."),
];

pub(super) const FIELDS: &[Field] = &[
    TITLE,
    needed("kind", Form::Word(&["lathe", "mill"]), "What it is."),
    field("stiffness_class", Form::Word(&["soft", "medium", "stiff"]), "A word; numbers are in `compliance`."),
    field("compliance", Form::Group(COMPLIANCES), "How far it yields per newton."),
    field("spindle", Form::Group(SPINDLE), "What the spindle can give."),
    field("travel", Form::Group(TRAVEL), "How large a part may be, and how fast it is traversed."),
    field("control", Form::Group(CONTROL), "The control."),
    field("price", Form::Group(PRICE), "What it costs."),
    field("models", Form::NamedTexts, "Stored models in force, by calculator: `name@revision`."),
    field("history", Form::List(HISTORY, 1000), "Models that were in force; only grows."),
    NOTE,
    TAGS,
];
