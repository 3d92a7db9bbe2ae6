//! Units as print writes them.

/// The international symbol of a unit of the contract: `um/N` becomes `µm/N`, `N/mm2` becomes
/// `N/mm²`, `N*mm` becomes `N·mm`; empty for `1`, the unit of plain numbers.
pub fn unit_symbol(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        "percent" => "%".to_owned(),
        "deg" => "°".to_owned(),
        _ => spelled(unit),
    }
}

fn spelled(unit: &str) -> String {
    let mut text = String::with_capacity(unit.len() + 4);
    let mut word = String::new();
    for c in unit.chars() {
        if c.is_alphabetic() {
            word.push(c);
            continue;
        }
        text.push_str(symbol(&word));
        // A digit straight after a word is its power.
        let power = !word.is_empty() || text.ends_with('⁻');
        word.clear();
        match c {
            '*' => text.push('·'),
            '-' => text.push('⁻'),
            digit if power && digit.is_ascii_digit() => text.push(superscript(digit)),
            other => text.push(other),
        }
    }
    text.push_str(symbol(&word));
    text
}

fn symbol(word: &str) -> &str {
    match word {
        "um" => "µm",
        "us" => "µs",
        "urad" => "µrad",
        "deg" => "°",
        other => other,
    }
}

/// A digit or minus, raised.
pub(super) fn superscript(c: char) -> char {
    match c {
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        '-' | '−' => '⁻',
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols() {
        for (unit, symbol) in [
            ("1", ""),
            ("mm", "mm"),
            ("um", "µm"),
            ("um/N", "µm/N"),
            ("N/mm2", "N/mm²"),
            ("N*mm/rad", "N·mm/rad"),
            ("N*s/mm", "N·s/mm"),
            ("rad/(N*mm)", "rad/(N·mm)"),
            ("min-1", "min⁻¹"),
            ("percent", "%"),
            ("um/(m*K)", "µm/(m·K)"),
            ("number", "number"),
        ] {
            assert_eq!(unit_symbol(unit), symbol);
        }
    }
}
