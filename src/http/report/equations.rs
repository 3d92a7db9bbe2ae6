//! What the equations say that answers name, from the documentation of the physics.

use std::collections::HashMap;
use std::sync::LazyLock;

#[derive(rust_embed::RustEmbed)]
#[folder = "docs/physics"]
struct Papers;

/// Lines of an equation that are shown.
const MOST_LINES: usize = 12;

static FORMULAS: LazyLock<HashMap<String, Vec<String>>> = LazyLock::new(|| {
    let papers = Papers::iter().filter_map(|name| String::from_utf8(Papers::get(&name)?.data.into_owned()).ok());
    papers.flat_map(|paper| formulas(&paper)).collect()
});

/// The lines of an equation; none where it is described in words.
pub(super) fn formula(number: &str) -> &'static [String] {
    FORMULAS.get(number).map_or(&[], Vec::as_slice)
}

/// Numbers of a paper's headings, each with the lines of the formulas below it.
fn formulas(paper: &str) -> Vec<(String, Vec<String>)> {
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    let (mut is_formula, mut is_code, mut is_numbered) = (false, false, false);
    for line in paper.lines() {
        if line.starts_with("```") {
            is_formula = !is_code && line == "```text";
            is_code = !is_code;
        } else if is_code {
            if let Some((_, lines)) = found.last_mut().filter(|_| is_formula && is_numbered)
                && lines.len() < MOST_LINES
            {
                lines.push(line.to_owned());
            }
        } else if let Some(heading) = line.strip_prefix('#') {
            let number = heading.trim_start_matches('#').split_whitespace().next().filter(|word| is_number(word));
            is_numbered = number.is_some();
            found.extend(number.map(|number| (number.to_owned(), Vec::new())));
        }
    }
    found
}

/// `deflection/3.1`
fn is_number(word: &str) -> bool {
    word.split_once('/').is_some_and(|(paper, number)| {
        paper.bytes().all(|byte| byte.is_ascii_lowercase()) && number.starts_with(|first: char| first.is_ascii_digit())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_are_found_by_their_numbers() {
        assert_eq!(formula("deflection/3.1"), ["W(x) = x²(l-x)²/(3EJl) + (1 - x/l)² w_h + (x/l)² w_t + w_c"]);
        assert!(formula("nothing").is_empty());
        assert!(FORMULAS.values().filter(|lines| !lines.is_empty()).count() > 40);
        let paper =
            "## a/1 One\n```text\nx = 1\n```\n```sh\nls\n```\n## Two\n```text\ny = 2\n```\n### a/2 Three\nwords\n";
        assert_eq!(formulas(paper), [("a/1".to_owned(), vec!["x = 1".to_owned()]), ("a/2".to_owned(), vec![])]);
    }
}
