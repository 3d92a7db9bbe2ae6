//! Who may know whom: physics knows nothing of the service, the engine nothing of HTTP, HTTP nothing of SQL.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All Rust files below a folder (or the file itself).
fn sources(place: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![root().join(place)];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    assert!(!found.is_empty(), "no source at {place}");
    found
}

/// The code of a file: without comments, and without the test module at its end.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]\n#[allow").next().unwrap().split("#[cfg(test)]\nmod tests {").next().unwrap();
    text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

fn forbid(place: &str, words: &[&str], except: &[&str]) {
    for path in sources(place) {
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
        if except.iter().any(|part| name.contains(part)) {
            continue;
        }
        let code = code(&path);
        for word in words {
            assert!(!code.contains(word), "{name} uses {word}");
        }
    }
}

#[test]
fn physics_is_pure() {
    let words = [
        "tokio",
        "axum",
        "sqlx",
        "hyper",
        "async fn",
        "std::fs",
        "std::net",
        "std::io",
        "std::env",
        "std::thread",
        "Instant::",
        "SystemTime",
        "println!",
        "tracing::",
        "static mut",
        "thread_local",
    ];
    for place in ["crates/precut-num/src", "crates/precut-calc/src"] {
        forbid(place, &words, &[]);
    }
    // Values by the names of their fields, as effects are moved and read, and no text.
    let by_name = ["diagnosis/model/known.rs", "calculator/diagnosable.rs", "effects/open.rs"];
    forbid("crates/precut-calc/src", &["serde_json"], &by_name);
    forbid("crates/precut-calc/src", &["serde_json::from_str", "serde_json::to_string", "serde_json::to_vec"], &[]);
}

#[test]
fn the_compute_crates_depend_on_nothing_of_the_service() {
    let numerics = ["clarabel", "nalgebra", "rand", "rand_pcg", "rayon", "rustfft", "statrs", "thiserror"];
    let jobs = ["precut-num", "serde", "serde_json", "sobol_burley", "utoipa"];
    for (package, allowed) in [("precut-num", numerics.to_vec()), ("precut-calc", [&numerics[..], &jobs].concat())] {
        let manifest = std::fs::read_to_string(root().join("crates").join(package).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        for name in manifest["dependencies"].as_table().unwrap().keys() {
            assert!(allowed.contains(&name.as_str()), "{package} depends on {name}");
        }
    }
}

/// The folders of a room in the order in which they know each other. What is asked and the physics are one: they know the
/// words of an answer (`output`), not how it is said.
#[test]
fn each_folder_of_a_room_knows_those_before_it_alone() {
    let diagnosis: &[&[&str]] = &[&["rows"], &["statistics"], &["causes"], &["verdict"], &["model"], &["answer"]];
    let process: &[&[&str]] = &[&["part"], &["change"], &["history"], &["answer"]];
    let calculator: &[&[&str]] = &[&["job", "model"], &["answer"], &["measured"]];
    for (room, order) in [
        ("diagnosis", diagnosis),
        ("process", process),
        ("deflection_compensation", calculator),
        ("feed_schedule", calculator),
        ("fixture_stability", calculator),
        ("ring_roundness", calculator),
        ("program_compensation", calculator),
        ("milling_stability", calculator),
    ] {
        for (place, folders) in order.iter().enumerate() {
            let later = order[place + 1..].iter().flat_map(|later| *later);
            let later: Vec<String> =
                later.flat_map(|later| [format!("{room}::{later}::"), format!("super::super::{later}::")]).collect();
            for folder in folders.iter().map(|folder| format!("crates/precut-calc/src/{room}/{folder}")) {
                if root().join(&folder).exists() {
                    forbid_paths(&folder, &later);
                }
            }
        }
    }
}

/// Forbids paths, but for those to the words of an answer.
fn forbid_paths(folder: &str, paths: &[String]) {
    for file in sources(folder) {
        let code = code(&file);
        for path in paths {
            let found = code.split(path.as_str()).skip(1).find(|rest| !rest.starts_with("output"));
            assert!(
                found.is_none(),
                "{} uses {path}{}",
                file.display(),
                found.unwrap_or_default().lines().next().unwrap_or("")
            );
        }
    }
}

#[test]
fn the_engine_knows_no_http() {
    forbid("src/engine", &["axum", "hyper", "crate::http", "StatusCode", "sqlx"], &[]);
    forbid("src/registry", &["axum", "hyper", "crate::http", "crate::engine", "sqlx"], &[]);
    forbid("src/store", &["axum", "hyper", "crate::http", "crate::engine"], &[]);
    forbid("src/render", &["axum", "hyper", "tokio", "sqlx", "crate::http", "crate::engine", "crate::store"], &[]);
}

#[test]
fn http_holds_neither_sql_nor_physics() {
    forbid("src/http", &["sqlx", "SELECT ", "deflection_compensation", "num::beam"], &[]);
    forbid("src/cli", &["sqlx", "axum", "deflection_compensation"], &[]);
}

/// Nothing outside its room names a calculator: one line in the compute crate's `lib.rs` brings it in.
#[test]
fn no_part_of_the_service_names_a_calculator() {
    let compute = code(&root().join("crates/precut-calc/src/lib.rs"));
    assert!(compute.contains("deflection_compensation::DeflectionCompensation"));
    forbid("src", &["deflection_compensation", "DeflectionCompensation"], &[]);
}

#[test]
fn every_metric_is_explained() {
    let macros = ["counter!", "gauge!", "histogram!"];
    let text: String = sources("src").iter().map(|path| code(path)).collect();
    // The name behind each macro of that beginning, which may stand on the next line.
    let names = |begin: &str| -> Vec<String> {
        macros
            .iter()
            .flat_map(|kind| text.split(&format!("{begin}{kind}(")).skip(1).collect::<Vec<_>>())
            .filter_map(|rest| rest.trim_start().strip_prefix('"')?.split('"').next().map(str::to_owned))
            .collect()
    };
    let (used, explained) = (names("metrics::"), names("metrics::describe_"));
    assert!(used.len() > 15, "{used:?}");
    for name in &used {
        assert!(explained.contains(name), "{name} has no description");
    }
    for name in &explained {
        assert!(used.contains(name), "{name} is described and never counted");
    }
}

/// What the papers for maintainers call a file is one.
#[test]
fn the_papers_name_files_that_exist() {
    for paper in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = std::fs::read_to_string(root().join(paper)).unwrap();
        let quoted = text.split('`').skip(1).step_by(2);
        let names: Vec<&str> = quoted
            .filter(|word| word.contains('/') && !word.starts_with("/v1") && !word.contains([' ', '*', '\n']))
            .filter(|word| !word.contains("NAME"))
            .collect();
        assert!(names.len() > 8, "{paper}: {names:?}");
        for name in names {
            assert!(root().join(name).exists(), "{paper} names {name}");
        }
    }
}
