//! Headings of measured tables as people write them: `Vc (m/min)`, `cutting speed [m/min]`, `Schnittgeschwindigkeit, m/min`,
//! `Скорость резания, м/мин`.

use crate::registry::TableColumn;
use crate::units;

/// Fields without their unit and what else they are called, lower case, in English, German and Russian. A letter may
/// stand for two fields; the unit decides.
const NAMES: &[(&str, &[&str])] = &[
    ("speed", &["v", "vc", "v_c", "cutting speed", "schnittgeschwindigkeit", "скорость резания", "скорость"]),
    ("feed", &["f", "fn", "s", "feed per revolution", "feed rate", "vorschub", "подача", "подача на оборот"]),
    (
        "depth",
        &[
            "ap",
            "a_p",
            "t",
            "depth of cut",
            "cutting depth",
            "schnitttiefe",
            "zustellung",
            "глубина резания",
            "глубина",
        ],
    ),
    (
        "cutting_edge_angle",
        &[
            "kappa",
            "kappa_r",
            "kr",
            "κ",
            "κr",
            "φ",
            "phi",
            "lead angle",
            "approach angle",
            "einstellwinkel",
            "угол в плане",
            "главный угол в плане",
        ],
    ),
    ("tool_life", &["t", "life", "standzeit", "стойкость", "стойкость инструмента", "период стойкости"]),
    ("roughness", &["ra", "surface roughness", "rauheit", "mittenrauwert", "rautiefe", "шероховатость"]),
    (
        "force_y",
        &["fp", "fy", "py", "f_p", "p_y", "passive force", "radial force", "passivkraft", "радиальная сила", "сила py"],
    ),
    (
        "force_z",
        &[
            "fc",
            "fz",
            "pz",
            "f_c",
            "p_z",
            "cutting force",
            "main force",
            "tangential force",
            "schnittkraft",
            "сила резания",
            "главная сила",
            "сила pz",
        ],
    ),
    ("hardening", &["n", "degree of hardening", "verfestigung", "степень наклёпа", "степень наклепа"]),
    (
        "hardening_depth",
        &["hc", "h_c", "depth of hardening", "verfestigungstiefe", "глубина наклёпа", "глубина наклепа"],
    ),
];

/// Units as they stand in headings, beside the spellings that are units everywhere.
const UNITS: &[(&str, &str)] = &[
    ("м/мин", "m/min"),
    ("mm/u", "mm/rev"),
    ("mm/umdr", "mm/rev"),
    ("мм/об", "mm/rev"),
    ("мм", "mm"),
    ("мкм", "um"),
    ("н", "N"),
    ("мин", "min"),
    ("grad", "deg"),
    ("град", "deg"),
    ("u/min", "rev/min"),
    ("об/мин", "rev/min"),
];

/// A heading without its unit, and the unit: `name [unit]`, `name (unit)`, `name, unit`, `name in unit`.
pub(super) fn split(cell: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, unit)) = cell.strip_suffix(close).and_then(|cell| cell.rsplit_once(open)) {
            return (name.trim(), Some(spelled(unit.trim())));
        }
    }
    for between in [",", " in ", " в "] {
        if let Some((name, unit)) = cell.rsplit_once(between) {
            let unit = spelled(unit.trim());
            if units::alike(unit).next().is_some() {
                return (name.trim(), Some(unit));
            }
        }
    }
    (cell.trim(), None)
}

/// The contract's spelling of a unit.
fn spelled(unit: &str) -> &str {
    let low = unit.to_lowercase();
    UNITS.iter().find(|(known, _)| *known == low).map_or(unit, |(_, spelling)| spelling)
}

/// The field that a heading with a unit means by another name; the unit tells fields of one letter apart.
pub(super) fn meant<'a>(name: &str, unit: &str, columns: &'a [TableColumn]) -> Option<&'a TableColumn> {
    let name = name.trim().to_lowercase().replace('_', " ");
    let is_called = |field: &TableColumn| {
        let stem = field.name.strip_suffix(units::suffix(&field.unit).as_str()).unwrap_or(&field.name);
        let names = NAMES.iter().filter(|(known, _)| *known == stem).flat_map(|(_, names)| names.iter());
        names.clone().any(|known| known.replace('_', " ") == name)
    };
    columns.iter().find(|field| is_called(field) && units::convert(1.0, unit, &field.unit).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::CellKind;

    fn columns() -> Vec<TableColumn> {
        let of = |name: &str, unit: &str| TableColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
            kind: CellKind::Number,
            required: false,
        };
        vec![
            of("speed_m_per_min", "m/min"),
            of("feed_mm_per_rev", "mm/rev"),
            of("depth_mm", "mm"),
            of("tool_life_min", "min"),
            of("roughness_um", "um"),
            of("force_z_n", "N"),
        ]
    }

    fn field(cell: &str) -> Option<String> {
        let (name, unit) = split(cell);
        meant(name, unit?, &columns()).map(|field| field.name.clone())
    }

    #[test]
    fn headings_as_people_write_them() {
        for (heading, expected) in [
            ("Vc (m/min)", "speed_m_per_min"),
            ("cutting speed [m/min]", "speed_m_per_min"),
            ("Cutting_Speed, ft/min", "speed_m_per_min"),
            ("Schnittgeschwindigkeit in m/min", "speed_m_per_min"),
            ("Скорость резания, м/мин", "speed_m_per_min"),
            ("f (mm/U)", "feed_mm_per_rev"),
            ("Подача, мм/об", "feed_mm_per_rev"),
            ("ap [mm]", "depth_mm"),
            ("Schnitttiefe (mm)", "depth_mm"),
            ("t, мм", "depth_mm"),
            ("T [min]", "tool_life_min"),
            ("Ra (µm)", "roughness_um"),
            ("Шероховатость, мкм", "roughness_um"),
            ("Fc (N)", "force_z_n"),
        ] {
            assert_eq!(field(heading).as_deref(), Some(expected), "{heading}");
        }
    }

    /// A name without its unit may be anything, and a unit of another kind is another column.
    #[test]
    fn what_is_not_certain_is_not_guessed() {
        for heading in ["Vc", "T", "Vc (mm)", "Ra (N)", "batch, day", "(m/min)"] {
            assert_eq!(field(heading), None, "{heading}");
        }
        assert_eq!(split("coolant, kind"), ("coolant, kind", None));
    }
}
