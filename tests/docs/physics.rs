//! The pages on physics: every equation that the program cites has its heading, every cause its numbers, every code
//! its line.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use precut::registry::Registry;
use precut_calc::effects::{
    Cause, DEFLECTION_CAUSES, FIXTURE_CAUSES, Fit, MACHINABILITY_CAUSES, MILLING_CAUSES, Parameter, RING_CAUSES,
};

use super::markdown::{Document, documents};
use super::root;

/// Catalogues and the page that has their numbers.
const CATALOGUES: [(&[Cause], &str); 5] = [
    (DEFLECTION_CAUSES, "docs/physics/effects-deflection.md"),
    (FIXTURE_CAUSES, "docs/physics/effects-fixture.md"),
    (MACHINABILITY_CAUSES, "docs/physics/effects-machinability.md"),
    (MILLING_CAUSES, "docs/physics/effects-milling.md"),
    (RING_CAUSES, "docs/physics/effects-ring.md"),
];

/// Groups of equations.
const GROUPS: [&str; 12] = [
    "clamping/",
    "cylindricity/",
    "deflection/",
    "diagnosis/",
    "feed/",
    "fit/",
    "fixture/",
    "library/",
    "milling/",
    "program/",
    "ring/",
    "roundness/",
];

/// Equations that have a heading: its first word.
fn documented() -> BTreeSet<String> {
    let pages = documents(root());
    let physics = pages.iter().filter(|page| page.name.starts_with("docs/physics/"));
    let first = |heading: &str| heading.split(' ').next().unwrap_or_default().to_owned();
    physics.flat_map(|page| page.headings().map(first).collect::<Vec<_>>()).collect()
}

/// Numbers of equations in a text, such as `deflection/4.1`.
fn cited(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for group in GROUPS {
        for (at, _) in text.match_indices(group) {
            let rest = &text[at + group.len()..];
            let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
            let number = rest[..end].trim_end_matches('.');
            if !number.is_empty() {
                found.push(format!("{group}{number}"));
            }
        }
    }
    found
}

fn sources(folder: &Path, cites: &mut BTreeMap<String, String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, cites);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            for number in cited(&std::fs::read_to_string(&path).unwrap()) {
                cites.insert(number, path.display().to_string());
            }
        }
    }
}

#[test]
fn every_equation_cited_in_the_source_is_documented() {
    let mut cites = BTreeMap::new();
    sources(&root().join("crates"), &mut cites);
    sources(&root().join("src"), &mut cites);
    assert!(cites.len() > 20, "{cites:?}");
    let documented = documented();
    let missing: Vec<_> = cites.iter().filter(|(number, _)| !documented.contains(*number)).collect();
    assert!(missing.is_empty(), "no heading in docs/physics for {missing:?}");
}

/// Those of all examples stand beside their numbers.
#[test]
fn every_equation_of_an_answer_is_documented() {
    let documented = documented();
    let mut count = 0;
    for file in std::fs::read_dir(root().join("tests/golden")).unwrap() {
        let golden: serde_json::Value = serde_json::from_slice(&std::fs::read(file.unwrap().path()).unwrap()).unwrap();
        for equation in golden["equations"].as_array().unwrap().iter().map(|equation| equation.as_str().unwrap()) {
            assert!(documented.contains(equation), "{equation}, cited by an answer");
            count += 1;
        }
    }
    assert!(count > 50, "{count}");
}

/// A row of the catalogue as it must stand on its page.
fn row(parameter: &Parameter) -> String {
    let (fit, prior) = match parameter.fit {
        Fit::Amplitude | Fit::Shape { grid: [] } => ("fitted".to_owned(), parameter.prior_sd.to_string()),
        Fit::Factor => ("logarithm fitted".to_owned(), parameter.prior_sd.to_string()),
        Fit::Shape { grid } => {
            let grid: Vec<String> = grid.iter().map(f64::to_string).collect();
            (format!("grid {}", grid.join(", ")), parameter.prior_sd.to_string())
        }
        Fit::Fixed { default } => (format!("stated; a diagnosis takes {default}"), "-".to_owned()),
        Fit::OfJob => ("of the job".to_owned(), "-".to_owned()),
    };
    let Parameter { name, unit, lower, upper, .. } = parameter;
    format!("| `{name}` | {unit} | {fit} | {prior} | {lower} to {upper} |")
}

/// The part of the page on one cause.
fn section<'t>(page: &str, text: &'t str, cause: &Cause) -> &'t str {
    let heading = format!("### {} `{}`\n", cause.equation, cause.kind);
    let Some((_, rest)) = text.split_once(&heading) else { panic!("{page} has no heading {heading}") };
    rest.split("\n#").next().unwrap()
}

#[test]
fn the_catalogues_have_the_numbers_of_the_code() {
    for (causes, page) in CATALOGUES {
        let text = Document::read(root(), page).text;
        for cause in causes {
            let section = section(page, &text, cause);
            for parameter in cause.parameters {
                let row = row(parameter);
                // A job may leave out some of what is stated, and a diagnosis all of it.
                let optional = row.replace("stated; a diagnosis takes", "stated, default");
                let stands = section.lines().any(|line| line == row || line == optional);
                assert!(stands, "{}: no row {row}", cause.kind);
            }
            for other in cause.conditions.iter().chain(cause.confounded_with) {
                assert!(section.contains(&format!("`{other}`")), "{}: {other} is not named", cause.kind);
            }
        }
    }
}

#[test]
fn every_code_of_a_calculator_is_explained() {
    let registry = Registry::standard().unwrap();
    for entry in registry.entries() {
        let page = format!("docs/physics/{}.md", entry.meta().id);
        let text = Document::read(root(), &page).text;
        let codes = &entry.meta().codes;
        let groups = codes.faults.iter().chain(codes.failures).chain(codes.warnings).copied();
        let missing: Vec<_> = groups.flatten().filter(|code| !text.contains(&format!("`{code}`"))).collect();
        assert!(missing.is_empty(), "{page} does not name {missing:?}");
    }
}
