//! A disk that is full, and one that cannot be written.
//!
//! As root a small file system in memory is mounted; elsewhere the process gets a limit on the size of its files, by
//! which its writes fail alike (the second half of the test).

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use crate::small_disk::SmallDisk;
use crate::stream::process_file;
use crate::support::{address_of, header, precut_command};
use crate::watch::{Service, assert_intact, database, refused_start, until};

fn job(length: usize, duration_ms: u32) -> Value {
    json!({"length_mm": length, "load_n": 1, "duration_ms": duration_ms})
}

/// What each kind of write comes to while the disk takes nothing.
async fn with_a_full_disk(service: &Service, running: &str, length: usize) -> Vec<String> {
    let mut counts = Vec::new();
    // Results are not kept; their answers are given.
    let large = json!({"length_mm": length, "load_n": 1, "stations": 20_000});
    let direct = service.post(&large).send().await.unwrap();
    assert_eq!(direct.status(), 200);
    until("the result to be turned away by the store", async || {
        (service.figure("precut_store_failures_total", "").await > 0.0).then_some(())
    })
    .await;
    counts.push("result: answered, not kept".to_owned());
    // A job that cannot be recorded is not accepted.
    let refused = service.post(&job(length + 1, 20)).header("prefer", "respond-async").send().await.unwrap();
    let status = refused.status().as_u16();
    let said: Value = refused.json().await.unwrap();
    assert_eq!((status, &said["code"]), (507, &json!("disk_full")), "{said:#}");
    counts.push("job: 507 disk_full".to_owned());
    let study = json!({
        "calculator": "sagging-bar", "job": {"load_n": 1, "stations": 5000},
        "vary": [{"pointer": "/length_mm", "from": length, "to": length + 50, "count": 11}],
    });
    let direct = service.post_to("/v1/studies", &study).send().await.unwrap();
    assert_eq!(direct.status(), 200);
    counts.push("study: answered, not kept".to_owned());
    // A cancel cannot be recorded either.
    let cancel = service.request(reqwest::Method::DELETE, running).send().await.unwrap();
    assert_eq!(cancel.status(), 507, "{}", cancel.text().await.unwrap());
    counts.push("cancel: 507".to_owned());
    let state = service.job(running).await;
    assert!(matches!(state["state"].as_str(), Some("running" | "queued")), "{state:#}");
    counts.push(format!("a job's end and progress: it stays {} and can be read", state["state"].as_str().unwrap()));
    counts
}

#[tokio::test]
async fn with_a_full_disk_answers_go_on_jobs_are_refused_and_nothing_breaks() {
    let Some(disk) = SmallDisk::new("6m") else {
        println!("no small disk can be mounted here: see the test with a limit on files");
        return;
    };
    let service = Service::start(&disk.path().join("data"), &[]).await;
    let first = service.accepted(&job(100, 20)).await;
    service.over(&first).await;
    let running = service.accepted(&job(101, 1500)).await;
    // A study writes its shards while it runs: it goes on once there is room.
    let study = json!({
        "calculator": "sagging-bar", "job": {"load_n": 1, "duration_ms": 30},
        "vary": [{"pointer": "/length_mm", "from": 200, "to": 239, "count": 40}],
    });
    let long = service.post_to("/v1/studies", &study).header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(long.status(), 202);
    let long = header(&long, "location").to_owned();
    disk.fill();
    let counts = with_a_full_disk(&service, &running, 1000).await;
    disk.make_room();
    assert_eq!(service.over(&running).await["state"], "succeeded", "it is recorded once there is room");
    assert_eq!(service.over(&long).await["state"], "succeeded");
    let again = service.accepted(&job(1001, 20)).await;
    assert_eq!(service.over(&again).await["state"], "succeeded");
    // Full at its start: it says so.
    service.stop();
    assert_intact(&disk.path().join("data")).await;
    disk.fill();
    let other = disk.path().join("other");
    let (code, said) = refused_start(&other);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot be used"), "{said}");
    disk.make_room();
    println!("full disk, by kind of write:\n  {}\n  start: refused, {}", counts.join("\n  "), said.trim());
}

#[tokio::test]
async fn a_part_that_a_full_disk_did_not_take_is_taken_once_there_is_room() {
    let Some(disk) = SmallDisk::new("6m") else {
        println!("no small disk can be mounted here");
        return;
    };
    let data = disk.path().join("data");
    let mut child =
        precut_command(&["serve", "--listen", "127.0.0.1:0", "--data", data.to_str().unwrap()]).spawn().unwrap();
    let address = address_of(&mut child);
    let client = reqwest::Client::new();
    let put = async |path: String, body: &Value| {
        let sent =
            client.put(format!("http://{address}/v1/processes/shaft-560{path}")).json(body).send().await.unwrap();
        (sent.status().as_u16(), sent.json::<Value>().await.unwrap())
    };
    let mut process = process_file("r01-tailstock-softer.json");
    let parts = process["parts"].take();
    process.as_object_mut().unwrap().remove("parts");
    assert_eq!(put(String::new(), &process).await.0, 201);
    let part = async |number: usize| put(format!("/parts/p-{number}"), &parts[number - 1]).await;
    for number in 1..=3 {
        assert_eq!(part(number).await.0, 201);
    }
    disk.fill();
    let mut number = 4;
    let (status, said) = loop {
        // What is left of a page takes a part or two.
        let (status, said) = part(number).await;
        if status != 201 {
            break (status, said);
        }
        number += 1;
    };
    assert_eq!((status, &said["code"]), (507, &json!("disk_full")), "{said:#}");
    let state = client.get(format!("http://{address}/v1/processes/shaft-560/state")).send().await.unwrap();
    assert_eq!(state.json::<Value>().await.unwrap()["parts"], number - 1, "it was not taken");
    disk.make_room();
    let (status, said) = part(number).await;
    assert_eq!((status, &said["parts"], &said["sequence"]), (201, &json!(number), &json!(number + 1)), "{said:#}");
    child.kill().unwrap();
    child.wait().unwrap();
    assert_intact(&data).await;
}

#[tokio::test]
async fn on_a_disk_that_became_read_only_answers_go_on_until_it_is_writable_again() {
    let Some(disk) = SmallDisk::new("6m") else {
        println!("no disk can be mounted here");
        return;
    };
    let service = Service::start(&disk.path().join("data"), &[]).await;
    let first = service.accepted(&job(100, 20)).await;
    service.over(&first).await;
    // A file system with open files for writing refuses to become read-only; then there is nothing to test.
    let while_serving = disk.remount("ro");
    println!("made read-only while it serves: {}", if while_serving { "yes" } else { "not possible here" });
    if while_serving {
        let direct = service.post(&job(200, 0)).send().await.unwrap();
        assert_eq!(direct.status(), 200);
        let refused = service.post(&job(201, 20)).header("prefer", "respond-async").send().await.unwrap();
        assert!(matches!(refused.status().as_u16(), 503 | 507));
        assert!(disk.remount("rw"));
        let again = service.accepted(&job(202, 20)).await;
        assert_eq!(service.over(&again).await["state"], "succeeded");
    }
    service.stop();
    assert!(disk.remount("ro"));
    let (code, said) = refused_start(&disk.path().join("data"));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot be used"), "{said}");
    println!("read-only at the start: refused, {}", said.trim());
    assert!(disk.remount("rw"));
    assert_intact(&disk.path().join("data")).await;
}

/// The same by a limit on the size of files, which needs no rights. The signal that comes with it is ignored.
#[tokio::test]
async fn where_files_may_not_grow_answers_go_on_and_jobs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = limited(folder.path()).spawn().unwrap();
    let address = crate::support::address_of(&mut child);
    let client = reqwest::Client::new();
    let post = |job: Value, prefer: &'static str| {
        client
            .post(format!("http://{address}/v1/sagging-bar"))
            .header("content-type", "application/json")
            .header("prefer", prefer)
            .body(job.to_string())
            .send()
    };
    let mut accepted = Vec::new();
    let mut refused = 0;
    for length in 0..400 {
        // Large answers fill the file.
        let direct = json!({"length_mm": 1000 + length, "load_n": 1, "stations": 20_000});
        assert_eq!(post(direct, "handling=lenient").await.unwrap().status(), 200);
        let response = post(job(5000 + length, 1), "respond-async").await.unwrap();
        match response.status().as_u16() {
            202 => accepted.push(header(&response, "location").to_owned()),
            503 | 507 => refused += 1,
            other => panic!("{other}: {}", response.text().await.unwrap()),
        }
        if refused >= 3 {
            break;
        }
    }
    assert!(refused >= 3, "the limit was reached");
    assert_eq!(client.get(format!("http://{address}/health/live")).send().await.unwrap().status(), 200);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_intact(folder.path()).await;
    // Without the limit everything accepted is there and ends.
    let service = Service::start(folder.path(), &[]).await;
    for address in &accepted {
        assert_eq!(service.over(address).await["state"], "succeeded");
    }
    println!("files limited: {} jobs accepted and done, {refused} refused", accepted.len());
    let mut database = database(folder.path()).await;
    let on_record: i64 = sqlx::query_scalar("SELECT count(*) FROM jobs").fetch_one(&mut database).await.unwrap();
    assert_eq!(usize::try_from(on_record).unwrap(), accepted.len(), "what was refused is not on record");
    service.stop();
}

/// The service with files of at most 1.5 MiB.
fn limited(folder: &Path) -> Command {
    let inner = crate::support::toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", folder.to_str().unwrap()]);
    let mut command = Command::new("sh");
    // Blocks of 512 bytes where POSIX rules, of 1024 in bash.
    command.args(["-c", "trap '' XFSZ; ulimit -f 5000; exec \"$0\" \"$@\""]).arg(inner.get_program());
    command.args(inner.get_args());
    for (name, value) in inner.get_envs() {
        match value {
            Some(value) => command.env(name, value),
            None => command.env_remove(name),
        };
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}
