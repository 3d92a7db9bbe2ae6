//! The documentation is held to the program: its commands run, its answers are those of the service, its equations
//! are those that the code cites, its links and its figure are there.

#![allow(clippy::unwrap_used, clippy::panic)]

mod console;
mod glossary;
mod markdown;
mod physics;
mod shown;
mod tailstock;

#[path = "../support/stream.rs"]
mod stream;

use std::path::Path;

use console::Console;
use markdown::{Document, documents};

/// The README's figures of examples and the commands that draw them.
const FIGURES: [(&str, &str); 2] = [
    ("docs/figures/shaft-90x2000.svg", "precut example deflection-compensation | precut solve --format svg"),
    (
        "docs/figures/diagnosis-headstock.svg",
        "precut example diagnosis | precut solve --format svg --figure residuals_along",
    ),
];
/// The README's ring and the command that draws it from the job above it.
const RING: &str = "docs/figures/ring-300.svg";
const DRAW_RING: &str = "precut solve --calculator ring-roundness --format svg ring.json";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Blocks of a document as they run: ` ```console ` has commands after `$ ` (continued after `> `) with what they
/// print, ` ```LANGUAGE answer ` is what the last command printed, ` ```LANGUAGE file=NAME ` is a file that later
/// commands read. `...` stands for anything. Whatever else is in a fence is only to be read.
fn run(document: &Document) -> Vec<String> {
    let blocks = document.blocks();
    if blocks.iter().all(|block| block.language() != "console") {
        return Vec::new();
    }
    let mut console = Console::new();
    let mut faults = Vec::new();
    for block in &blocks {
        let place = format!("{}:{}", document.name, block.line);
        let outcome = match (block.language(), block.role()) {
            ("console", "") => console.session(&block.text),
            (_, role) if role.starts_with("file=") => console.file(&role["file=".len()..], &block.text),
            (language, "answer") => console.answer(language, &block.text),
            ("json" | "console", _) => Err("mark it as `answer` or `file=NAME`, or it is not checked".to_owned()),
            _ => Ok(()),
        };
        faults.extend(outcome.err().map(|fault| format!("{place}: {fault}")));
    }
    faults
}

#[test]
fn every_command_runs_and_prints_what_is_shown() {
    let faults: Vec<String> = documents(root()).iter().flat_map(run).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
}

#[test]
fn readme_and_interface_have_commands_that_are_checked() {
    for name in ["README.md", "docs/api.md", "docs/operations.md"] {
        let document = Document::read(root(), name);
        let commands = document.blocks().iter().filter(|block| block.language() == "console").count();
        assert!(commands >= 3, "{name} has {commands} blocks of commands");
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut faults = Vec::new();
    for document in documents(root()) {
        for link in document.links() {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let folder = Path::new(&document.name).parent().unwrap();
            let target = if file.is_empty() { Path::new(&document.name).to_owned() } else { folder.join(file) };
            if !root().join(&target).exists() {
                faults.push(format!("{}: {link} is not there", document.name));
            } else if !anchor.is_empty() {
                let name = target.to_str().unwrap();
                if !Document::read(root(), name).anchors().iter().any(|known| known == anchor) {
                    faults.push(format!("{}: {name} has no heading #{anchor}", document.name));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_figures_are_what_the_command_line_draws() {
    let readme = Document::read(root(), "README.md").text;
    for (figure, draw) in FIGURES {
        let drawn = Console::without_server().output(draw);
        let kept = std::fs::read_to_string(root().join(figure)).unwrap_or_default();
        assert!(drawn.trim_end() == kept.trim_end(), "{figure} is stale: {draw} --output {figure}");
        assert!(readme.contains(figure) && readme.contains(draw), "the README shows {figure} and how to draw it");
    }
}

/// The README's ring, from the job that stands above it.
#[test]
fn the_ring_is_what_the_command_line_draws() {
    let readme = Document::read(root(), "README.md");
    let job = readme.blocks().into_iter().find(|block| block.role() == "file=ring.json").unwrap().text;
    let mut console = Console::without_server();
    console.file("ring.json", &job).unwrap();
    let drawn = console.output(DRAW_RING);
    let kept = std::fs::read_to_string(root().join(RING)).unwrap();
    assert!(drawn.trim_end() == kept.trim_end(), "{RING} is stale: {DRAW_RING} --output {RING}");
    assert!(readme.text.contains(RING), "the README shows the ring");
    let shown = DRAW_RING.replace("--format svg", "--format svg --output ring.svg");
    assert!(readme.text.contains(&shown), "the README shows how to draw it");
}

#[test]
fn the_figures_of_speed_have_their_place() {
    let readme = Document::read(root(), "README.md").text;
    let begin = readme.find("<!-- figures:begin -->").unwrap();
    let end = readme.find("<!-- figures:end -->").unwrap();
    assert!(begin < end);
}

#[test]
fn every_problem_of_the_service_is_listed() {
    let listed = Document::read(root(), "docs/api.md").text;
    for (code, status) in precut::http::CODES {
        let listed =
            listed.lines().any(|line| line.contains(&format!("`{code}`")) && line.contains(&status.to_string()));
        assert!(listed, "docs/api.md does not list {status} {code}");
    }
}

#[test]
fn every_setting_of_the_operations_page_exists() {
    let settings: toml::Table = toml::from_str(precut::config::DEFAULTS).unwrap();
    let known = |path: &str| {
        let mut names = path.split('.');
        let first = names.next().and_then(|name| settings.get(name));
        names.try_fold(first, |value, name| value.map(|value| value.get(name))).flatten().is_some()
    };
    let text = Document::read(root(), "docs/operations.md").text;
    let sections = ["log.", "limits.", "jobs.", "cache.", "shutdown.", "cors.", "auth."];
    let named: Vec<&str> = text
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| sections.iter().any(|section| word.starts_with(section)))
        .collect();
    assert!(named.len() > 5, "{named:?}");
    for name in named {
        assert!(known(name), "there is no setting {name}");
    }
}

#[test]
fn a_page_that_shows_something_else_is_caught() {
    let page = |text: &str| run(&Document { name: "page.md".to_owned(), text: text.replace("~~~", "```") });
    let listed = "~~~console\n$ precut list\n...\ndeflection-compensation  ...\n...\n~~~\n";
    assert_eq!(page(listed), Vec::<String>::new());
    for (wrong, line) in [
        ("~~~console\n$ precut list\nfeed-schedule  ...\n~~~\n", 1),
        ("~~~console\n$ precut no-such-command\n~~~\n", 1),
        (&format!("{listed}\n~~~json\n{{}}\n~~~\n"), 8),
        (&format!("{listed}\n~~~json answer\n{{ ... }}\n~~~\n"), 8),
        (
            "~~~console\n$ curl http://127.0.0.1:8080/health/live\n~~~\n~~~json answer\n{ \"status\": \"dead\", ... }\n~~~\n",
            4,
        ),
    ] {
        let faults = page(wrong);
        assert_eq!(faults.len(), 1, "{wrong}{faults:?}");
        assert!(faults[0].starts_with(&format!("page.md:{line}:")), "{faults:?}");
    }
}
