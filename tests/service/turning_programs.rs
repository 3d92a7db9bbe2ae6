//! Programs that a job brings along: read, or refused word by word.

use precut::registry::Registry;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

use crate::jobs::until;
use crate::support::{Server, header, problem};

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

/// An example with its program as bytes of a shop: CR LF, and a comment in Latin-1.
fn shaft() -> (Value, Vec<u8>) {
    let registry = Registry::standard().unwrap();
    let mut job: Value =
        serde_json::from_str(registry.entry("program-compensation").unwrap().meta().examples[1].job).unwrap();
    let text = job.as_object_mut().unwrap().remove("nc_program").unwrap();
    let text = text.as_str().unwrap().replace('\n', "\r\n").replace("(ROUGH)", "(\u{d6}L)");
    (job, text.chars().map(|letter| u8::try_from(letter).unwrap()).collect())
}

fn form(job: &Value, program: &[u8]) -> Form {
    let program = Part::bytes(program.to_vec()).file_name("shaft.nc");
    Form::new().text("job", job.to_string()).part("nc_program", program)
}

/// What a unified diff makes of a file, line ends and all.
fn patched(given: &[u8], diff: &[u8]) -> Vec<u8> {
    let lines = |text: &[u8]| text.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect::<Vec<_>>();
    let given = lines(given);
    let (mut out, mut at) = (Vec::new(), 0);
    let mut diff = lines(diff).into_iter().skip_while(|line| !line.starts_with(b"@@")).peekable();
    while let Some(head) = diff.next() {
        let head = String::from_utf8(head).unwrap();
        let from: usize = head.trim_start_matches("@@ -").split(',').next().unwrap().parse().unwrap();
        out.extend(given[at..from - 1].concat());
        at = from - 1;
        while let Some(line) = diff.next_if(|line| !line.starts_with(b"@@")) {
            match line[0] {
                b'+' => out.extend(&line[1..]),
                sign => {
                    assert_eq!(line[1..], given[at], "line {}", at + 1);
                    at += 1;
                    if sign == b' ' {
                        out.extend(&line[1..]);
                    }
                }
            }
        }
    }
    out.extend(given[at..].concat());
    out
}

#[tokio::test]
async fn a_program_comes_as_a_file_and_goes_back_in_its_own_bytes() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let (job, given) = shaft();
    let ask = |job: &Value, accept: &'static str| {
        server.client.post(server.url(ROOM)).header("accept", accept).multipart(form(job, &given)).send()
    };
    let response = ask(&job, "text/x-gcode").await.unwrap();
    assert_eq!(header(&response, "content-type"), "text/x-gcode; charset=iso-8859-1");
    assert_eq!(header(&response, "content-disposition"), "attachment; filename=\"program.nc\"");
    let place = header(&response, "content-location").to_owned();
    let returned = response.bytes().await.unwrap();
    // The diff is of the same bytes, and lies in the cache with the rest of the answer.
    let response = ask(&job, "text/x-diff").await.unwrap();
    assert_eq!(header(&response, "content-type"), "text/x-diff; charset=iso-8859-1");
    assert_eq!((header(&response, "precut-cache"), header(&response, "content-location")), ("hit", place.as_str()));
    let diff = response.bytes().await.unwrap();
    assert!(diff.starts_with(b"--- given\n+++ corrected\n@@ "));
    assert_eq!(patched(&given, &diff), returned);
    let unchanged = b"N20 T0101 (\xd6L)\r\n";
    assert!(returned.windows(unchanged.len()).any(|window| window == unchanged) && returned != given);
    // The same text in JSON is the same job, if it says which bytes it was.
    let mut whole = job.clone();
    whole["nc_program"] = given.iter().copied().map(char::from).collect::<String>().into();
    whole["reading"]["encoding"] = "latin_1".into();
    let response = server.post_to(ROOM, whole.to_string()).send().await.unwrap();
    assert_eq!((header(&response, "precut-cache"), header(&response, "content-location")), ("hit", place.as_str()));
    // A kept result has the same forms.
    let kept = server.get(&place).header("accept", "text/x-gcode").send().await.unwrap();
    assert_eq!(kept.bytes().await.unwrap(), returned);
    // So has a job.
    let mut other = job.clone();
    other["carriage"]["compliance_um_per_n"] = 0.011.into();
    let request = server.client.post(server.url(ROOM)).header("prefer", "respond-async");
    let accepted = request.multipart(form(&other, &given)).send().await.unwrap();
    assert_eq!(accepted.status(), 202);
    let address = header(&accepted, "location").to_owned();
    until(&server, &address, &["succeeded"]).await;
    let result = server.get(&format!("{address}/result")).header("accept", "text/x-gcode").send().await.unwrap();
    let of_job = result.bytes().await.unwrap();
    assert!(of_job != returned && of_job.starts_with(b"%\r\nO0042\r\n"), "{of_job:?}");
}

#[tokio::test]
async fn a_stamp_is_one_comment_that_changes_nothing() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let (mut job, given) = shaft();
    job["mode"]["stamp"] = true.into();
    let ask = |accept: &'static str| {
        server.client.post(server.url(ROOM)).header("accept", accept).multipart(form(&job, &given)).send()
    };
    let answer: Value = ask("application/json").await.unwrap().json().await.unwrap();
    let returned = ask("text/x-gcode").await.unwrap().bytes().await.unwrap();
    let diff = ask("text/x-diff").await.unwrap().bytes().await.unwrap();
    assert_eq!(patched(&given, &diff), returned);
    let text: String = returned.iter().copied().map(char::from).collect();
    let lines: Vec<&str> = text.split("\r\n").collect();
    let key = answer["key"].as_str().unwrap();
    assert!(lines[2].starts_with("(precut ") && lines[2].contains(key), "{}", lines[2]);
    // Without it the program is that of the answer, whose proof stands in it, and both make the same moves.
    let bare = [&lines[..2], &lines[3..]].concat().join("\r\n");
    assert_eq!(answer["result"]["compensation"]["nc_program"], bare);
    let mut read = job.clone();
    read["mode"] = json!({ "kind": "read" });
    let mut moves = Vec::new();
    for program in [&text, &bare] {
        read["nc_program"] = program.as_str().into();
        let answer: Value = server.post_to(ROOM, read.to_string()).send().await.unwrap().json().await.unwrap();
        let mut read = answer["result"]["moves"].clone();
        read.as_object_mut().unwrap().remove("line");
        moves.push(read);
    }
    assert_eq!(moves[0], moves[1]);
}

#[tokio::test]
async fn what_cannot_be_given_back_or_read_is_refused() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let (mut job, given) = shaft();
    let ask = |job: &Value, program: &[u8]| {
        server.client.post(server.url(ROOM)).header("accept", "text/x-gcode").multipart(form(job, program)).send()
    };
    // It is read and not corrected.
    job["mode"]["kind"] = "read".into();
    problem(ask(&job, &given).await.unwrap(), 422, "no_program_returned").await;
    // The job says that it is UTF-8, and it is not.
    job["reading"]["encoding"] = "utf_8".into();
    let document = problem(ask(&job, &given).await.unwrap(), 422, "invalid_job").await;
    let [fault] = document["errors"].as_array().unwrap().as_slice() else { panic!("{document}") };
    assert_eq!((&fault["code"], &fault["pointer"]), (&json!("table_not_utf8"), &json!("/nc_program")));
    // It comes twice.
    job["nc_program"] = "G0 X1. Z1.".into();
    let document = problem(ask(&job, b"G0 X2. Z2.").await.unwrap(), 422, "invalid_job").await;
    assert_eq!(document["errors"][0]["code"], "table_given_twice");
    // A character that no byte of Latin-1 is.
    job["reading"]["encoding"] = "latin_1".into();
    job["nc_program"] = "G0 X1. Z1. (\u{412})".into();
    let document = problem(server.post_to(ROOM, job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    assert_eq!(document["errors"][0]["code"], "not_in_encoding");
}
