//! Words, units and numbers by which the header of an instrument's file says what is in it.

/// Degrees in a radian.
pub(super) const DEG_PER_RAD: f64 = 180.0 / std::f64::consts::PI;

/// Words by which columns are named, all in lower case. A name begins with one of them or is one.
pub(super) const ANGLE: &[&str] = &[
    "angle",
    "ang",
    "winkel",
    "угол",
    "theta",
    "θ",
    "phi",
    "φ",
    "ángulo",
    "angulo",
    "angolo",
    "角",
    "kąt",
    "úhel",
    "açı",
    "азимут",
    "rotation",
];
pub(super) const RADIUS: &[&str] =
    &["radius", "rad.", "радиус", "rayon", "raggio", "radio", "半径", "promień", "poloměr"];
pub(super) const HEIGHT: &[&str] =
    &["z", "height", "höhe", "hoehe", "высота", "hauteur", "altezza", "altura", "高度", "wysokość", "výška"];
pub(super) const DIAMETER: &[&str] =
    &["diameter", "durchmesser", "диаметр", "diamètre", "diametro", "diámetro", "直径", "ø"];
pub(super) const DEVIATION: &[&str] = &[
    "deviation",
    "dev",
    "abweichung",
    "отклонение",
    "откл",
    "écart",
    "ecart",
    "scostamento",
    "desviación",
    "desviacion",
    "偏差",
    "odchyłka",
    "odchylka",
    "profile",
    "profil",
    "профиль",
    "delta",
    "δ",
    "Δ",
    "error",
    "fehler",
    "amplitude",
    "rundheit",
    "roundness",
    "круглость",
    "form",
    "radial",
    "value",
    "wert",
    "signal",
    "messwert",
];
pub(super) const INDEX: &[&str] = &[
    "index",
    "no",
    "nr",
    "№",
    "номер",
    "point",
    "punkt",
    "pt",
    "точка",
    "n°",
    "i",
    "n",
    "#",
    "lfd",
    "step",
    "zeit",
    "time",
    "время",
];
pub(super) const CLOCKWISE: &[&str] =
    &["clockwise", "cw", "im uhrzeigersinn", "uhrzeigersinn", "по часовой", "horaire", "orario", "horario"];
pub(super) const COUNTER: &[&str] = &[
    "counterclockwise",
    "counter-clockwise",
    "anticlockwise",
    "anti-clockwise",
    "ccw",
    "gegen den uhrzeigersinn",
    "против часовой",
    "antihoraire",
    "antiorario",
    "antihorario",
];

pub(super) fn has_word(line: &str, words: &[&str]) -> bool {
    words.iter().any(|word| {
        line.match_indices(word).any(|(at, _)| {
            let edge = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
            edge(line[..at].chars().next_back()) && edge(line[at + word.len()..].chars().next())
        })
    })
}

pub(super) fn is_named(name: &str, words: &[&str]) -> bool {
    let bare = name.trim_start_matches(['[', '(', '"']);
    words.iter().any(|word| {
        bare.strip_prefix(word)
            .is_some_and(|rest| word.chars().count() > 3 || rest.chars().next().is_none_or(|c| !c.is_alphabetic()))
    })
}

/// The unit at the end of a name: mm per unit of a length, or degrees per unit of an angle.
pub(super) fn unit_of(name: &str) -> Option<(bool, f64)> {
    const LENGTHS: &[(&str, f64)] = &[
        ("µm", 1e-3),
        ("μm", 1e-3),
        ("um", 1e-3),
        ("мкм", 1e-3),
        ("micron", 1e-3),
        ("microns", 1e-3),
        ("nm", 1e-6),
        ("нм", 1e-6),
        ("mm", 1.0),
        ("мм", 1.0),
        ("cm", 10.0),
        ("m", 1e3),
        ("inch", 25.4),
        ("in", 25.4),
        ("µin", 25.4e-6),
        ("uin", 25.4e-6),
    ];
    const ANGLES: &[(&str, f64)] = &[
        ("deg", 1.0),
        ("°", 1.0),
        ("grad", 1.0),
        ("градусы", 1.0),
        ("град", 1.0),
        ("degrees", 1.0),
        ("degré", 1.0),
        ("rad", DEG_PER_RAD),
        ("рад", DEG_PER_RAD),
        ("mdeg", 1e-3),
    ];
    let words = name
        .split(|c: char| !(c.is_alphanumeric() || c == '°' || c == 'µ' || c == 'μ'))
        .filter(|word| !word.is_empty());
    for word in words.collect::<Vec<_>>().into_iter().rev() {
        if let Some((_, size)) = LENGTHS.iter().find(|(unit, _)| *unit == word) {
            return Some((true, *size));
        }
        if let Some((_, size)) = ANGLES.iter().find(|(unit, _)| *unit == word) {
            return Some((false, *size));
        }
    }
    None
}

/// The number after the first colon, equals sign or blank of a line of the header, with its unit.
fn stated(line: &str) -> Option<(f64, Option<f64>)> {
    let after = line.split_once([':', '=', ';', '\t']).map_or(line, |(_, after)| after);
    let word =
        after.split(|c: char| c.is_whitespace() || c == ';').find(|word| word.chars().any(|c| c.is_ascii_digit()))?;
    let number: String =
        word.chars().take_while(|c| c.is_ascii_digit() || matches!(c, '.' | ',' | '-' | '+')).collect();
    let value = number.replace(',', ".").parse().ok()?;
    Some((value, unit_of(line).filter(|(length, _)| *length).map(|(_, mm)| mm)))
}

pub(super) fn stated_radius_mm(heading: &[String]) -> Option<f64> {
    let nominal = ["nominal", "nenn", "soll", "номинал", "nominale", "nominel"];
    heading.iter().find_map(|line| {
        let (value, mm) = stated(line)?;
        let share = if DIAMETER.iter().any(|word| line.contains(word)) {
            0.5
        } else if RADIUS.iter().any(|word| line.contains(word)) {
            1.0
        } else {
            return None;
        };
        (nominal.iter().any(|word| line.contains(word)) && value > 0.0).then_some(value * share * mm.unwrap_or(1.0))
    })
}

/// The height that a line states after one of the words for it.
pub(super) fn stated_height_mm(line: &str) -> Option<f64> {
    let at = HEIGHT.iter().find_map(|word| {
        let edge = |c: Option<char>| c.is_none_or(|c| !c.is_alphabetic());
        line.match_indices(word)
            .find(|(at, _)| edge(line[..*at].chars().next_back()) && edge(line[at + word.len()..].chars().next()))
            .map(|(at, _)| at)
    })?;
    let after = &line[at..];
    let (value, mm) = stated(&after.replace(['=', ':'], " "))?;
    Some(value * mm.unwrap_or(1.0))
}

pub(super) fn magnification(line: &str) -> Option<f64> {
    let words = ["magnification", "vergrößerung", "vergroesserung", "увеличение", "grossissement", "ingrandimento"];
    words
        .iter()
        .any(|word| line.contains(word))
        .then(|| stated(&line.replace(['x', '×'], " ")).map(|(value, _)| value))
        .flatten()
        .filter(|by| *by > 0.0)
}
