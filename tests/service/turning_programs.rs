//! Programs that a job brings along: read, or refused word by word.

use precut::registry::Registry;
use serde_json::{Value, json};

use crate::support::{Server, problem};

const ROOM: &str = "/v1/program-compensation";

fn job(program: &str) -> String {
    json!({ "nc_program": program, "dialect": "fanuc_a", "mode": { "kind": "read" } }).to_string()
}

#[tokio::test]
async fn a_program_is_refused_with_every_word_that_is_not_understood() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let program = job("G21 G18 G99\nG0 X40. Z2.\n#1=2.\nG1 Z-5. F0.2 ,R2.\nM30\n");
    for (language, said) in [("en", "line 3, column 1: #1=2. is a variable"), ("ru", "строка 3, столбец 1: #1=2.")]
    {
        // From the second on the refusal is kept.
        let response = server.post_to(ROOM, program.clone()).header("accept-language", language).send().await.unwrap();
        let document = problem(response, 422, "program_not_read").await;
        assert_eq!(document["errors_total"], 2);
        let [first, second] = document["errors"].as_array().unwrap().as_slice() else { panic!("{document}") };
        assert_eq!((&first["code"], &first["pointer"]), (&json!("variable_in_program"), &json!("/nc_program")));
        assert!(first["detail"].as_str().unwrap().starts_with(said), "{first}");
        let place = |error: &Value| (error["values"]["line"].as_f64(), error["values"]["column"].as_f64());
        assert_eq!((place(second), &second["values"]["word"]), ((Some(4.0), Some(14.0)), &json!(",R2.")));
    }
}

#[tokio::test]
async fn the_moves_come_as_a_table() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let program = job("G21 G18 G99\nT0101\nG97 S500\nG0 X40. Z2.\nG1 Z-5. F0.2\nM30\n");
    let request = server.post_to(&format!("{ROOM}?table=moves"), program).header("accept", "text/csv");
    let table = request.send().await.unwrap().text().await.unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows[0].starts_with("line [1],kind,x_diameter [mm],z [mm]"), "{table}");
    assert!(rows[1].starts_with("4,rapid,40,2") && rows[2].starts_with("5,line,40,-5"), "{table}");
}
