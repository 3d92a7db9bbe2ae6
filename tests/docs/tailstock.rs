//! The README's story of the tailstock that softened, told by the program itself.

use serde_json::Value;

use super::console::Console;
use super::markdown::Document;
use super::root;
use super::stream::process_file;

/// The last part of the story.
const LAST: usize = 70;

#[test]
fn the_tailstock_of_the_readme_softened_as_it_says() {
    let mut process = process_file("r01-tailstock-softer.json");
    process["parts"].as_array_mut().unwrap().truncate(LAST);
    let mut console = Console::without_server();
    console.file("shaft-560.json", &process.to_string()).unwrap();
    let told = console.output("precut process replay shaft-560.json");
    let states: Vec<Value> = told.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let alarm = states.iter().find(|state| state["state"] == "changed").unwrap();
    let before = states.iter().take_while(|state| state["state"] != "changed");
    assert!(before.skip(20).all(|state| ["in_control", "warning"].contains(&state["state"].as_str().unwrap())));
    let change = &states[LAST - 1]["changes"][0];
    let cause = &change["causes"][0];
    let digits = |value: &Value| format!("{:.4}", value.as_f64().unwrap());
    let story = format!(
        "Part {} alarms. After part {LAST} it reads: since part {} `{}`, {} µm/N (95 %: {} to {}), with a\nprobability of {:.2}.",
        alarm["number"],
        change["since_part"],
        cause["kind"].as_str().unwrap(),
        digits(&cause["delta"]),
        digits(&cause["interval_95"][0]),
        digits(&cause["interval_95"][1]),
        cause["share"].as_f64().unwrap(),
    );
    let readme = Document::read(root(), "README.md").text;
    let begin = readme.find("<!-- tailstock:begin -->").unwrap();
    let end = readme.find("<!-- tailstock:end -->").unwrap();
    assert_eq!(readme[begin..end].trim_start_matches("<!-- tailstock:begin -->").trim(), story);
}
