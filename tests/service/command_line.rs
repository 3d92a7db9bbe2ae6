//! The command line, as real processes.

use std::io::Write;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::support::{Process, precut_command, toy, toy_command};

const FILE: &str = r#"{"calculator": "sagging-bar", "job": {"length_mm": 500.0, "load_n": 100.0}}"#;

fn run(arguments: &[&str], input: &str) -> Output {
    feed(toy_command(arguments), input)
}

/// The shipped binary.
fn precut(arguments: &[&str]) -> Output {
    feed_precut(arguments, "")
}

/// The same with something to read.
fn feed_precut(arguments: &[&str], input: &str) -> Output {
    feed(precut_command(arguments), input)
}

fn feed(mut command: Command, input: &str) -> Output {
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    // It may end before it has read everything.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

/// What the command wrote, without what the test harness around it says.
fn said(output: &Output) -> String {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    text.trim_start_matches("\nrunning 1 test\n").to_owned()
}

fn complaint(output: &Output) -> Value {
    serde_json::from_slice(&output.stderr).unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn a_job_file_is_solved_in_every_form() {
    let output = run(&["solve", "-"], FILE);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(answer["calculator"], toy::BAR);
    assert_eq!(answer["result"]["max_sag_um"], answer["explanation"][0]["values"]["sag_um"]);
    for (arguments, begins) in [
        (&["solve", "--format", "csv"][..], "z [mm],sag [um]\n0"),
        (&["solve", "--format", "csv", "--table", "summary"], "max_sag [um]\n"),
        (&["solve", "--format", "svg", "-"], "<svg"),
        (&["solve", "--format", "svg", "--figure", "load"], "<svg"),
        (&["solve", "--format", "gcode"], ""),
    ] {
        let output = run(arguments, FILE);
        assert!(output.status.success(), "{arguments:?} {}", String::from_utf8_lossy(&output.stderr));
        assert!(said(&output).starts_with(begins), "{arguments:?} {}", said(&output));
    }
}

#[test]
fn files_are_read_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let (job, out) = (folder.path().join("job.json"), folder.path().join("out.csv"));
    std::fs::write(&job, FILE).unwrap();
    let arguments = ["solve", job.to_str().unwrap(), "-f", "csv", "-o", out.to_str().unwrap()];
    assert!(run(&arguments, "").status.success());
    assert!(std::fs::read_to_string(&out).unwrap().starts_with("z [mm],sag [um]\n"));
    let bare = run(&["solve", "--calculator", toy::BAR], toy::JOB);
    assert!(bare.status.success(), "{}", String::from_utf8_lossy(&bare.stderr));
    let output = run(&["solve", "/nowhere/job.json"], "");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("/nowhere/job.json"));
}

#[test]
fn exit_codes_tell_whose_fault_it_is() {
    for (input, code, kind) in [
        ("{\"calculator\": \"sagging-bar\", \"job\": {\"length_mm\": -1, \"load\": 1}}", 2, "invalid_job"),
        ("{\"calculator\": \"saging-bar\", \"job\": {}}", 2, "unknown_calculator"),
        ("{\"calculator\": \"sagging-bar\", \"job\": {\"length_mm\": 1, \"length_mm\": 2}}", 2, "duplicate_key"),
        ("nonsense", 2, "bad_syntax"),
        ("", 2, "bad_syntax"),
        (
            "{\"calculator\": \"sagging-bar\", \"job\": {\"length_mm\": 500, \"load_n\": 1, \"behaviour\": \"infeasible\"}}",
            3,
            "bar_would_break",
        ),
    ] {
        let output = run(&["solve", "-"], input);
        assert_eq!(complaint(&output)["code"], kind, "{input}");
        // The harness around the toy only tells whether it was 0.
        assert!(!output.status.success(), "{input} should end with {code}");
    }
    assert_eq!(precut(&["solve", "/nowhere"]).status.code(), Some(1));
    assert_eq!(precut(&["solve", "--format", "png"]).status.code(), Some(2));
    assert_eq!(precut(&["schema", "no-such-calculator"]).status.code(), Some(2));
}

#[test]
fn a_check_computes_nothing_and_says_what_would_be_computed() {
    let fatal = r#"{"calculator": "sagging-bar", "job": {"length_mm": 500, "load_n": 1, "behaviour": "abort"}}"#;
    let output = run(&["check", "-"], fatal);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let checked: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(checked["input"]["stations"], 10);
    assert!(checked["key"].as_str().unwrap().starts_with("b3:"));
    let output = run(&["check"], r#"{"calculator": "sagging-bar", "job": {"length_mm": -1}}"#);
    assert_eq!(complaint(&output)["errors_total"], 2);
}

#[test]
fn places_of_faults_are_those_of_the_file() {
    let output = run(&["check"], "{\"calculator\": \"sagging-bar\",\n\"job\": {\n\"load_n\": 1,\n\"load_n\": 2}}");
    let detail = complaint(&output)["detail"].to_string();
    assert!(detail.contains("line 4"), "{detail}");
}

#[test]
fn what_can_be_asked_is_listed_with_schema_and_examples() {
    assert_eq!(said(&run(&["list"], "")), "sagging-bar  How far does the bar sag?\n");
    let schema: Value = serde_json::from_str(&said(&run(&["schema", toy::BAR], ""))).unwrap();
    assert_eq!(schema["properties"]["length_mm"]["x-unit"], "mm");
    let result: Value = serde_json::from_str(&said(&run(&["schema", toy::BAR, "--result"], ""))).unwrap();
    assert!(result["properties"]["max_sag_um"].is_object());
    let example = said(&run(&["example", toy::BAR], ""));
    assert!(run(&["solve"], &example).status.success());
    assert_eq!(said(&run(&["example", toy::BAR, "plain"], "")), example);
    let bare = said(&run(&["example", toy::BAR, "--job"], ""));
    assert!(run(&["solve", "-c", toy::BAR], &bare).status.success());
    let output = run(&["example", toy::BAR, "none"], "");
    assert!(String::from_utf8_lossy(&output.stderr).contains("plain"));
    let contract: Value = serde_json::from_str(&said(&run(&["openapi"], ""))).unwrap();
    assert!(contract["paths"]["/v1/sagging-bar"].is_object());
}

#[test]
fn help_and_version_are_worth_reading() {
    let help = String::from_utf8(precut(&["--help"]).stdout).unwrap();
    for part in
        ["serve", "solve", "check", "list", "schema", "example", "openapi", "health", "Examples:", "Exit codes:"]
    {
        assert!(help.contains(part), "{part} in {help}");
    }
    let version = String::from_utf8(precut(&["--version"]).stdout).unwrap();
    assert_eq!(version.trim(), format!("precut {}", env!("CARGO_PKG_VERSION")));
}

#[test]
fn settings_are_printed_and_refused_with_their_source() {
    let printed = String::from_utf8(precut(&["--print-config", "--listen", "127.0.0.1:9"]).stdout).unwrap();
    assert!(printed.contains("listen = \"127.0.0.1:9\""), "{printed}");
    let mut command = precut_command(&["--print-config"]);
    command.env("PRECUT_LIMITS_BURST", "none");
    let output = feed(command, "");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("PRECUT_LIMITS_BURST"), "{output:?}");
}

#[test]
fn a_key_is_hashed_for_the_settings() {
    let output = feed_precut(&["hash-key"], "0123456789abcdef\n");
    let hash = String::from_utf8(output.stdout).unwrap();
    assert_eq!(hash.trim(), precut::http::auth::hash("0123456789abcdef").to_string());
}

#[test]
fn health_asks_a_running_service() {
    let process = Process::start();
    let url = format!("http://{}", process.address);
    let output = precut(&["health", "--url", &url]);
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("ready"));
    drop(process);
    let output = precut(&["health", "--url", &url]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(precut(&["health", "--url", "ftp://x"]).status.code(), Some(1));
}

#[cfg(unix)]
#[test]
fn a_reader_that_leaves_early_is_no_panic() {
    let mut child = precut_command(&["openapi"]).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

#[test]
fn the_command_line_speaks_the_language_asked_for() {
    let list = precut(&["list", "--lang", "ru"]);
    assert!(said(&list).contains("Куда должен идти инструмент"), "{}", said(&list));
    let schema: Value = serde_json::from_str(&said(&precut(&["schema", "ring-roundness", "--lang", "ru"]))).unwrap();
    assert_eq!(schema["properties"]["ring"]["title"], "Кольцо");
    let bad = feed_precut(&["check", "--lang", "ru"], r#"{"calculator": "ring-roundness", "job": {}}"#);
    assert_eq!(bad.status.code(), Some(2));
    assert_eq!(complaint(&bad)["title"], "Задание составлено с ошибками");
    let unknown = precut(&["list", "--lang", "fi"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("en, ru"));
}

/// The example of a diagnosis without its rows, and the rows as a table.
fn diagnosis_and_table() -> (Value, String) {
    let mut file: Value = serde_json::from_str(&said(&precut(&["example", "diagnosis"]))).unwrap();
    let rows = file["job"].as_object_mut().unwrap().remove("measurements").unwrap();
    let line = |row: &Value| {
        let cell = |name: &str| row[name].to_string().replace('.', ",");
        ["run", "trace", "z_mm", "diameter_deviation_um"].map(cell).join(";")
    };
    let lines: Vec<String> = rows.as_array().unwrap().iter().map(line).collect();
    (file, format!("run;trace;z [mm];diameter_deviation [um]\n{}\n", lines.join("\n")))
}

#[test]
fn measurements_come_from_a_file_beside_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let (file, table) = diagnosis_and_table();
    let path = folder.path().join("shaft.csv");
    std::fs::write(&path, table).unwrap();
    let path = path.to_str().unwrap();
    let whole = precut(&["example", "diagnosis"]);
    let expected: Value = serde_json::from_str(&said(&feed_precut(&["check"], &said(&whole)))).unwrap();
    // The same data give the same key however they came, with the name of the field or without.
    for data in [path.to_owned(), format!("measurements={path}")] {
        let output = feed_precut(&["check", "--measured", &data], &file.to_string());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let checked: Value = serde_json::from_str(&said(&output)).unwrap();
        assert_eq!(checked["key"], expected["key"]);
    }
    let bare = file["job"].to_string();
    let solved = feed_precut(&["solve", "--calculator", "diagnosis", "--measured", path], &bare);
    let answer: Value = serde_json::from_str(&said(&solved)).unwrap();
    assert_eq!(answer["result"]["verdict"], "named");
    assert_eq!(answer["key"], expected["key"]);

    // Rows in the job and in a file, a file that is not there, a job that takes none.
    let twice = feed_precut(&["check", "--measured", path], &said(&whole));
    assert_eq!(complaint(&twice)["errors"][0]["code"], "table_given_twice");
    let absent = feed_precut(&["check", "--measured", "/nowhere/shaft.csv"], &file.to_string());
    assert_eq!(absent.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&absent.stderr).contains("/nowhere/shaft.csv"));
    let example = said(&precut(&["example", "fixture-stability"]));
    let none = feed_precut(&["check", "--measured", path], &example);
    assert_eq!(none.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&none.stderr).contains("takes no measured table"), "{none:?}");
    let example = said(&precut(&["example", "deflection-compensation"]));
    let several = feed_precut(&["check", "--measured", path], &example);
    assert_eq!(several.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&several.stderr).contains("force.rows"), "{several:?}");
}

#[test]
fn an_exported_model_extends_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lathe-7.json");
    let write = |document: &Value| std::fs::write(&path, document.to_string()).unwrap();
    let model = serde_json::json!({
        "name": "lathe-7", "revision": 3, "calculator": "deflection-compensation",
        "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": 0.022 }], "provenance": null
    });
    write(&model);
    let example = said(&precut(&["example", "deflection-compensation"]));
    let solve = |job: &str| feed_precut(&["solve", "--model", path.to_str().unwrap()], job);
    let answer: Value = serde_json::from_str(&said(&solve(&example))).unwrap();
    assert_eq!((&answer["model"]["name"], &answer["model"]["revision"]), (&"lathe-7".into(), &3.into()));
    assert_eq!(answer["effects"][0]["kind"], "headstock_compliance");
    // Results are called by their labels, with their units, and only where they changed.
    let changed = |answer: &Value| -> Vec<Value> {
        let said = answer["explanation"].as_array().unwrap().iter();
        said.filter(|said| said["code"] == "model_changed").cloned().collect()
    };
    let english = changed(&answer);
    assert!(!english.is_empty());
    for said in &english {
        let text = said["text"].as_str().unwrap();
        assert!(
            !text.split_whitespace().any(|word| word.starts_with('/')) && text.contains("the stored model lathe-7@3"),
            "{text}"
        );
        assert_ne!(said["values"]["with"], said["values"]["without"], "{text}");
    }
    let first = english[0]["text"].as_str().unwrap();
    assert!(first.starts_with("Form error is ") && first.contains(" µm; without"), "{first}");
    let russian = said(&feed_precut(&["solve", "--lang", "ru", "--model", path.to_str().unwrap()], &example));
    let russian = changed(&serde_json::from_str(&russian).unwrap());
    assert_eq!(russian.len(), english.len());
    let first = russian[0]["text"].as_str().unwrap();
    assert!(first.starts_with("Погрешность формы: ") && first.contains(" мкм; без"), "{first}");

    // A job may name it, any other name is a fault.
    let naming = |name: &str| {
        let mut file: Value = serde_json::from_str(&example).unwrap();
        file["job"]["model"] = name.into();
        file.to_string()
    };
    for name in ["lathe-7", "lathe-7@3"] {
        let named: Value = serde_json::from_str(&said(&solve(&naming(name)))).unwrap();
        assert_eq!(named["key"], answer["key"], "{name}");
    }
    for name in ["lathe-8", "lathe-7@2"] {
        let output = solve(&naming(name));
        assert_eq!(output.status.code(), Some(2));
        let fault = &complaint(&output)["errors"][0];
        assert_eq!((&fault["code"], &fault["pointer"]), (&"model_not_given".into(), &"/model".into()), "{name}");
    }
    // Of another calculator, damaged, no model at all, a job that takes none.
    let ring = said(&precut(&["example", "ring-roundness"]));
    assert_eq!(complaint(&solve(&ring))["errors"][0]["code"], "model_of_another_calculator");
    let evaluation = said(&precut(&["example", "roundness-evaluation"]));
    assert_eq!(complaint(&solve(&evaluation))["errors"][0]["code"], "job_without_model");
    let mut damaged = model.clone();
    damaged["sha256"] = "0".repeat(64).into();
    write(&damaged);
    assert_eq!(complaint(&solve(&example))["errors"][0]["code"], "model_damaged");
    write(&serde_json::json!({ "from_result": format!("b3:{}", "0".repeat(64)) }));
    assert_eq!(complaint(&solve(&example))["errors"][0]["code"], "model_not_exported");
}

#[tokio::test]
async fn a_job_names_a_model_of_a_data_folder_whoever_serves_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap().to_owned();
    let mut service = precut_command(&["serve", "--listen", "127.0.0.1:0", "--data", &data]).spawn().unwrap();
    let address = crate::support::address_of(&mut service);
    let model = serde_json::json!({
        "calculator": "deflection-compensation",
        "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": 0.022 }]
    });
    let put = reqwest::Client::new().put(format!("http://{address}/v1/models/lathe-7"));
    let stored = put.header("content-type", "application/json").body(model.to_string()).send().await.unwrap();
    assert!(stored.status().is_success(), "{}", stored.text().await.unwrap());

    let mut file: Value = serde_json::from_str(&said(&precut(&["example", "deflection-compensation"]))).unwrap();
    let mut solve = |name: &str| {
        file["job"]["model"] = name.into();
        feed_precut(&["solve", "--data", &data], &file.to_string())
    };
    let beside: Value = serde_json::from_str(&said(&solve("lathe-7"))).unwrap();
    assert_eq!(beside["model"]["name"], "lathe-7");
    assert_eq!(beside["effects"][0]["kind"], "headstock_compliance");
    service.kill().unwrap();
    service.wait().unwrap();
    let alone: Value = serde_json::from_str(&said(&solve("lathe-7@1"))).unwrap();
    assert_eq!(alone["key"], beside["key"]);
    // A name that is not there comes with the nearest; a folder without a database is said, and left as it was.
    let unknown = complaint(&solve("lathe-8"));
    assert_eq!(unknown["errors"][0]["code"], "unknown_model");
    assert!(unknown["errors"][0]["detail"].as_str().unwrap().contains("lathe-7"), "{unknown:#}");
    let empty = tempfile::tempdir().unwrap();
    let place = empty.path().to_str().unwrap();
    let refused = feed_precut(&["solve", "--data", place], &file.to_string());
    assert_eq!(refused.status.code(), Some(1), "{refused:?}");
    assert!(String::from_utf8_lossy(&refused.stderr).contains(place), "{refused:?}");
    assert_eq!(std::fs::read_dir(place).unwrap().count(), 0);
}

/// A byte more, as a line feed at the end, would be a fault of such a file.
#[test]
fn reports_and_workbooks_are_written_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ring.json");
    std::fs::write(&file, precut(&["example", "ring-clamping"]).stdout).unwrap();
    let file = file.to_str().unwrap();
    for (format, begins) in [("pdf", &b"%PDF-1.7"[..]), ("xlsx", b"PK")] {
        let path = folder.path().join(format);
        let written = precut(&["solve", file, "--format", format, "--lang", "ru", "--output", path.to_str().unwrap()]);
        assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
        let printed = precut(&["solve", file, "--format", format, "--lang", "ru"]).stdout;
        assert!(printed.starts_with(begins), "{format}");
        assert_eq!(std::fs::read(&path).unwrap(), printed, "{format}");
        assert_ne!(precut(&["solve", file, "--format", format]).stdout, printed, "{format} in English");
    }
}

#[test]
fn names_are_looked_up_in_files_and_data_folders() {
    let job = r#"{"calculator": "deflection-compensation", "job": {"machine": "lathe-3", "material": "4140",
        "shaft": {"segments": [{"length_mm": 300, "diameter_mm": 30, "stock_diameter_mm": 32}]},
        "supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "centre", "z_mm": 300}],
        "force": {"kind": "constant", "passive_n": 200}, "cut": {"feed_mm_per_rev": 0.2, "spindle_speed_rpm": 500}}}"#;
    let refused = feed_precut(&["solve", "-"], job);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(complaint(&refused)["errors"][0]["code"], "unknown_machine");
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("ours.json");
    let machine = r#"{"schema_version": 1, "machines": [{"id": "lathe-3", "kind": "lathe",
        "compliance": {"carriage_um_per_n": 0.02, "headstock_chuck_um_per_n": 0.01, "tailstock_centre_um_per_n": 0.03}}]}"#;
    std::fs::write(&library, machine).unwrap();
    let library = library.to_str().unwrap();
    let carriage = |output: &Output| -> Value {
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{output:?}"));
        answer["input"]["carriage"]["compliance_um_per_n"].clone()
    };
    assert_eq!(carriage(&feed_precut(&["solve", "-", "--library", library], job)), 0.02);
    // In the data folder of a service, while it runs.
    let service = Process::start();
    let put = std::process::Command::new("curl")
        .args(["--silent", "--fail", "--request", "PUT", "--json"])
        .arg(r#"{"kind": "lathe", "compliance": {"carriage_um_per_n": 0.05}}"#)
        .arg(format!("http://{}/v1/machines/lathe-3", service.address))
        .output();
    if put.is_ok_and(|put| put.status.success()) {
        let folder = service.folder.to_str().unwrap();
        assert_eq!(carriage(&feed_precut(&["solve", "-", "--data", folder], job)), 0.05);
    }
    let shown = precut(&["materials", "4140"]);
    let shown: Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!((&shown["name"], &shown["built_in"]), (&"42crmo4".into(), &true.into()));
    let own = precut(&["machines", "--library", library, "--search", "lathe-3"]);
    assert!(String::from_utf8_lossy(&own.stdout).starts_with("lathe-3"));
    let codes = precut(&["tools", "CNMG120408 PCLNR2525M12"]);
    let codes: Value = serde_json::from_slice(&codes.stdout).unwrap();
    assert_eq!(codes["geometry"]["cutting_edge_angle_deg"], 95.0);
    assert_eq!(precut(&["tools", "no such tool"]).status.code(), Some(2));
}

#[test]
fn a_program_is_corrected_beside_its_job() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let example = precut(&["example", "program-compensation", "slender_shaft"]);
    let mut job: Value = serde_json::from_str(&said(&example)).unwrap();
    let text = job["job"].as_object_mut().unwrap().remove("nc_program").unwrap();
    // Latin-1 and ends of lines of Windows.
    let given: Vec<u8> =
        text.as_str().unwrap().replace('\n', "\r\n").chars().map(|c| c as u8).chain(*b"(K\xF6rper)\r\n").collect();
    std::fs::write(path("shaft.nc"), &given).unwrap();
    std::fs::write(path("shaft.json"), job.to_string()).unwrap();
    let (program, job, out) = (path("shaft.nc"), path("shaft.json"), path("shaft.c.nc"));

    let output = precut(&["compensate", &program, "--job", &job, "-o", &out]);
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{complaints}");
    let diff = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(diff.contains(&format!("--- {program}\n+++ {out}\n@@ ")), "{diff}");
    let returned = std::fs::read(&out).unwrap();
    let lines = |bytes: &[u8]| bytes.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect::<Vec<_>>();
    let (old, new) = (lines(&given), lines(&returned));
    assert!(new.iter().filter(|line| !line.is_empty()).all(|line| line.ends_with(b"\r")));
    let gone = old.iter().filter(|line| !new.contains(line)).count();
    assert!((1..8).contains(&gone), "{gone} lines changed: {diff}");
    assert!(new.contains(&b"(K\xF6rper)\r".to_vec()));

    // Nothing is written without being asked, the given program never over itself.
    std::fs::remove_file(&out).unwrap();
    assert_eq!(precut(&["compensate", &program, "--job", &job, "--check"]).status.code(), Some(0));
    assert_eq!(precut(&["compensate", &program, "--job", &job, "-o", &program]).status.code(), Some(2));
    assert_eq!(std::fs::read(&program).unwrap(), given);
    assert_eq!(precut(&["compensate", &program, "--job", &job, "--in-place"]).status.code(), Some(0));
    assert_eq!(std::fs::read(&program).unwrap(), returned);

    // What the job asks for is done: here feeds alone.
    let mut feeds: Value = serde_json::from_slice(&std::fs::read(&job).unwrap()).unwrap();
    feeds["job"]["mode"]["kind"] = "refeed".into();
    feeds["job"]["refeed"] = serde_json::json!({ "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.4 });
    std::fs::write(path("feeds.json"), feeds.to_string()).unwrap();
    std::fs::write(&program, &given).unwrap();
    let output = precut(&["compensate", &program, "--job", &path("feeds.json"), "--check"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let diff = String::from_utf8_lossy(&output.stdout).into_owned();
    let new: Vec<&str> = diff.lines().filter(|line| line.starts_with("+N")).collect();
    // The old feed is put back where a block behind the cut relied on it.
    assert!(new.iter().any(|line| line.contains("F0.4")), "{diff}");
    assert!(new.iter().all(|line| line.contains("F0.4") || line.contains("F0.3") || line.contains("F0.15")), "{diff}");

    std::fs::write(&program, b"G21 G18 G99\nG0 X40. Z2.\n#1=2.\nM30\n").unwrap();
    let refused = precut(&["compensate", &program, "--job", &job, "--check"]);
    assert_eq!(refused.status.code(), Some(2));
    let complaints = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(complaints.contains(&format!("{program}:3:1: ")), "{complaints}");
}
