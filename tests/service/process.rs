//! The service as a process: start, signals, end.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::support::{Process, be_child, toy};

/// Not a test: the process that the others start.
#[test]
#[ignore = "started by other tests"]
fn child_process() {
    be_child();
}

fn request(method: &str, path: &str, body: &str) -> String {
    format!(
        "{method} {path} HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{body}",
        body.len()
    )
}

/// How long anything may take that does come to an end.
const PATIENCE: Duration = Duration::from_mins(1);

fn ask(address: std::net::SocketAddr, text: &str) -> std::io::Result<String> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.write_all(text.as_bytes())?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    Ok(answer)
}

/// Waits until it is so.
#[cfg(unix)]
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until the service has a request in work besides the one that asks.
#[cfg(unix)]
fn wait_for_work(address: std::net::SocketAddr) {
    wait_until("a request in work", || {
        let metrics = ask(address, &request("GET", "/metrics", "")).unwrap();
        let in_work = metrics.lines().find_map(|line| line.strip_prefix("http_requests_in_flight "));
        in_work.is_some_and(|count| count.trim().parse::<f64>().unwrap() >= 2.0)
    });
}

/// Waits until the service has heard that it is to end.
#[cfg(unix)]
fn wait_for_the_end_to_begin(address: std::net::SocketAddr) {
    let ready = request("GET", "/health/ready", "");
    // A connection that came as it heard of it may be cut off.
    wait_until("no longer ready", || ask(address, &ready).is_ok_and(|answer| answer.starts_with("HTTP/1.1 503 ")));
}

#[cfg(unix)]
#[test]
fn a_request_in_work_is_finished_before_the_process_ends() {
    for signal in ["TERM", "INT"] {
        let folder = tempfile::tempdir().unwrap();
        let gate = folder.path().join("gate");
        let settings = [(toy::HELD_MM, "100"), (toy::GATE, gate.to_str().unwrap()), ("PRECUT_SHUTDOWN_GRACE_S", "600")];
        let mut process = Process::start_with(&folder.path().join("data"), &settings);
        let address = process.address;
        let job = r#"{"length_mm": 100, "load_n": 1, "work_ms": 400}"#;
        let slow = std::thread::spawn(move || ask(address, &request("POST", "/v1/sagging-bar", job)));
        wait_for_work(address);
        process.signal(signal);
        wait_for_the_end_to_begin(address);
        // Nothing new is begun.
        let refused = ask(address, &request("POST", "/v1/sagging-bar", toy::JOB)).unwrap();
        assert!(refused.starts_with("HTTP/1.1 503 ") && refused.contains("shutting_down"), "{refused}");
        std::fs::write(&gate, "").unwrap();
        let answer = slow.join().unwrap().unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
        assert_eq!(process.wait(PATIENCE), Some(0), "{signal}");
    }
}

#[cfg(unix)]
#[test]
fn idle_connections_do_not_hold_the_process_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut process = Process::start_with(folder.path(), &[("PRECUT_SHUTDOWN_GRACE_S", "600")]);
    let mut idle = TcpStream::connect(process.address).unwrap();
    idle.write_all(b"GET /health/live HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
    let mut some = [0; 512];
    assert!(idle.read(&mut some).unwrap() > 0);
    let silent = TcpStream::connect(process.address).unwrap();
    process.signal("TERM");
    // Long before those have to go who have something in work.
    assert_eq!(process.wait(PATIENCE), Some(0));
    drop(silent);
}

#[cfg(unix)]
#[test]
fn a_second_signal_ends_the_process_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_SHUTDOWN_GRACE_S", "600"), ("PRECUT_LIMITS_BODY_TIMEOUT_S", "600")];
    let mut process = Process::start_with(folder.path(), &settings);
    // A request whose body stands in the middle: the first signal waits for it.
    let mut held = TcpStream::connect(process.address).unwrap();
    let head =
        "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 36\r\n\r\n{";
    held.write_all(head.as_bytes()).unwrap();
    wait_for_work(process.address);
    process.signal("TERM");
    wait_for_the_end_to_begin(process.address);
    process.signal("TERM");
    let code = process.wait(PATIENCE);
    assert!(code.is_some_and(|code| code != 0), "{code:?}");
}

#[cfg(unix)]
#[test]
fn results_survive_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let job = r#"{"length_mm": 123, "load_n": 4}"#;
    let mut caches = Vec::new();
    for _ in 0..2 {
        let mut process = Process::start_in(folder.path());
        let answer = ask(process.address, &request("POST", "/v1/sagging-bar", job)).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
        caches.push(answer.lines().find(|line| line.starts_with("precut-cache")).unwrap().to_owned());
        process.signal("TERM");
        assert_eq!(process.wait(PATIENCE), Some(0));
    }
    assert_eq!(caches, ["precut-cache: miss", "precut-cache: hit"]);
}

#[cfg(unix)]
#[test]
fn a_killed_job_is_finished_by_the_next_process() {
    let folder = tempfile::tempdir().unwrap();
    let job = r#"{"length_mm": 100, "load_n": 1, "duration_ms": 600}"#;
    let mut process = Process::start_with(folder.path(), &[(toy::HELD_MM, "100")]);
    let address = accepted(&process, job);
    until(&process, &address, "running");
    process.signal("KILL");
    process.wait(PATIENCE);
    let process = Process::start_in(folder.path());
    assert_eq!(until(&process, &address, "succeeded")["attempt"], 2);
    let result = ask(process.address, &request("GET", &format!("{address}/result"), "")).unwrap();
    assert!(result.starts_with("HTTP/1.1 200 ") && result.contains("max_sag_um"), "{result}");
}

/// The document of a job, from its address.
#[cfg(unix)]
fn job(process: &Process, address: &str) -> serde_json::Value {
    let answer = ask(process.address, &request("GET", address, "")).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
    serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
}

#[cfg(unix)]
fn accepted(process: &Process, job: &str) -> String {
    let answer = ask(process.address, &request("POST", "/v1/sagging-bar", job)).unwrap();
    assert!(answer.starts_with("HTTP/1.1 202 "), "{answer}");
    answer.lines().find_map(|line| line.strip_prefix("location: ")).unwrap().to_owned()
}

#[cfg(unix)]
fn until(process: &Process, address: &str, state: &str) -> serde_json::Value {
    let start = Instant::now();
    loop {
        let job = job(process, address);
        if job["state"] == state {
            return job;
        }
        assert!(start.elapsed() < PATIENCE, "{job:#}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[cfg(unix)]
#[test]
fn a_job_that_a_shutdown_interrupts_is_put_back_without_a_charge() {
    let folder = tempfile::tempdir().unwrap();
    let mut process = Process::start_with(folder.path(), &[(toy::HELD_MM, "100")]);
    let address = accepted(&process, r#"{"length_mm": 100, "load_n": 1, "duration_ms": 600}"#);
    assert_eq!(until(&process, &address, "running")["attempt"], 1);
    process.signal("TERM");
    assert_eq!(process.wait(PATIENCE), Some(0));
    let process = Process::start_in(folder.path());
    assert_eq!(until(&process, &address, "succeeded")["attempt"], 1);
}

#[cfg(unix)]
#[test]
fn a_job_that_ends_its_process_each_time_is_given_up_and_its_neighbours_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let slots = ("PRECUT_JOBS_SLOTS", "1");
    let gate = folder.path().join("gate");
    let held = [(toy::HELD_MM, "101"), (toy::GATE, gate.to_str().unwrap()), slots];
    let data = folder.path().join("data");
    let mut process = Process::start_with(&data, &held);
    let waiting = accepted(&process, r#"{"length_mm": 101, "load_n": 1, "duration_ms": 600}"#);
    let deadly = r#"{"length_mm": 100, "load_n": 1, "behaviour": "abort", "duration_ms": 501}"#;
    let deadly = accepted(&process, deadly);
    let after = accepted(&process, r#"{"length_mm": 102, "load_n": 1, "duration_ms": 600}"#);
    std::fs::write(&gate, "").unwrap();
    let mut deaths = 0;
    let failed = loop {
        if process.child.try_wait().unwrap().is_some() {
            deaths += 1;
            process = loop {
                assert!(deaths <= 2, "the third start has a process of its own");
                // It may die before it says where it listens.
                match Process::try_start_with(&data, &[slots]) {
                    Some(next) => break next,
                    None => deaths += 1,
                }
            };
        }
        let answer = ask(process.address, &request("GET", &deadly, "")).unwrap_or_default();
        if answer.contains("\"state\":\"failed\"") {
            break job(&process, &deadly);
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!((deaths, failed["attempt"].as_u64()), (2, Some(3)));
    assert_eq!(failed["problem"]["code"], "crashed_repeatedly");
    for address in [&waiting, &after] {
        until(&process, address, "succeeded");
    }
    let result = ask(process.address, &request("GET", &format!("{deadly}/result"), "")).unwrap();
    assert!(result.starts_with("HTTP/1.1 500 ") && result.contains("crashed_repeatedly"), "{result}");
}

#[test]
fn a_folder_in_use_or_a_port_taken_is_said_and_ends_with_1() {
    let process = Process::start();
    let folder = process.folder.to_str().unwrap().to_owned();
    let output =
        crate::support::toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", &folder]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("in use"), "{said}");
    let other = tempfile::tempdir().unwrap();
    let address = process.address.to_string();
    let folder = other.path().to_str().unwrap();
    let output = crate::support::toy_command(&["serve", "--listen", &address, "--data", folder]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("cannot listen on") && said.contains(&address), "{said}");
}

#[cfg(unix)]
#[test]
fn a_job_whose_process_is_killed_from_outside_is_finished_however_often() {
    let folder = tempfile::tempdir().unwrap();
    let gate = folder.path().join("gate");
    let held = [(toy::HELD_MM, "103"), (toy::GATE, gate.to_str().unwrap())];
    let data = folder.path().join("data");
    let mut process = Process::start_with(&data, &held);
    let address = accepted(&process, r#"{"length_mm": 103, "load_n": 1, "duration_ms": 600}"#);
    for kill in 1..=5 {
        until(&process, &address, "running");
        process.signal("KILL");
        process.wait(Duration::from_mins(1));
        process = Process::start_with(&data, &held);
        assert_eq!(job(&process, &address)["problem"], serde_json::Value::Null, "killed {kill} times");
    }
    until(&process, &address, "running");
    std::fs::write(&gate, "").unwrap();
    until(&process, &address, "succeeded");
    assert!(job(&process, &address)["attempt"].as_u64().unwrap() >= 6);
}

#[cfg(unix)]
#[test]
fn keys_are_read_again_without_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let settings = folder.path().join("precut.toml");
    let write = |keys: &[&str]| {
        let key = |key: &&str| format!("{{ name = \"{}\", hash = \"{}\" }}", &key[..3], precut::http::auth::hash(key));
        let keys: Vec<String> = keys.iter().map(key).collect();
        std::fs::write(&settings, format!("[auth]\nkeys = [{}]\n", keys.join(", "))).unwrap();
    };
    let (old, new) = ("old key of a client", "new key of a client");
    write(&[old]);
    let data = folder.path().join("data");
    let process = Process::start_with(&data, &[("PRECUT_CONFIG", settings.to_str().unwrap())]);
    let status = |key: &str| {
        let head =
            format!("GET /v1/jobs HTTP/1.1\r\nHost: x\r\nConnection: close\r\nAuthorization: Bearer {key}\r\n\r\n");
        ask(process.address, &head).unwrap().split(' ').nth(1).unwrap().to_owned()
    };
    let becomes = |key: &str, wanted: &str| {
        let begun = std::time::Instant::now();
        while status(key) != wanted {
            assert!(begun.elapsed() < Duration::from_mins(1), "{key} is not {wanted}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    assert_eq!((status(old), status(new)), ("200".to_owned(), "401".to_owned()));
    // Both for a while, as a key is replaced; told by a signal.
    write(&[old, new]);
    process.signal("HUP");
    becomes(new, "200");
    assert_eq!(status(old), "200");
    // Seen by itself.
    write(&[new]);
    becomes(old, "401");
    // The last key is not taken away, nor is one for what cannot be read: that would open the service.
    write(&[]);
    process.signal("HUP");
    std::fs::write(&settings, "[auth]\nkeys = 1\n").unwrap();
    process.signal("HUP");
    write(&[new, old]);
    process.signal("HUP");
    becomes(old, "200");
}

#[test]
fn a_copy_is_taken_while_it_serves_checked_and_put_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let run = |arguments: &[&str]| {
        let output = crate::support::precut_command(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        (output.status.code(), said)
    };
    let process = Process::start_in(&folder.path().join("data"));
    let address = accepted(&process, r#"{"length_mm": 104, "load_n": 1, "duration_ms": 600}"#);
    until(&process, &address, "succeeded");
    let (code, said) = run(&["backup", "--data", &at("data"), &at("copy.db")]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("copied: 1 jobs, 1 results, 0 revisions"), "{said}");
    let (code, said) = run(&["backup", "--data", &at("data"), &at("copy.db")]);
    assert!(code == Some(1) && said.contains("nothing is overwritten"), "{said}");
    assert_eq!(run(&["verify", &at("copy.db")]).0, Some(0));
    // Not over a folder that has a database, whether somebody uses it or not.
    let (code, said) = run(&["restore", "--data", &at("data"), &at("copy.db")]);
    assert!(code == Some(1) && said.contains("in use"), "{said}");
    assert_eq!(run(&["restore", "--data", &at("again"), &at("copy.db")]).0, Some(0));
    let (code, said) = run(&["restore", "--data", &at("again"), &at("copy.db")]);
    assert!(code == Some(1) && said.contains("nothing is overwritten"), "{said}");
    let again = Process::start_in(&folder.path().join("again"));
    assert_eq!(job(&again, &address)["state"], "succeeded");
    let result = |process: &Process| ask(process.address, &request("GET", &format!("{address}/result"), "")).unwrap();
    let content = |answer: String| answer.split_once("\r\n\r\n").unwrap().1.to_owned();
    assert_eq!(content(result(&again)), content(result(&process)));
    // One bit is enough.
    let mut bytes = std::fs::read(at("copy.db")).unwrap();
    let place = bytes.len() / 2;
    bytes[place] ^= 1;
    std::fs::write(at("copy.db"), bytes).unwrap();
    let (code, said) = run(&["verify", &at("copy.db")]);
    assert!(code == Some(1) && said.contains("checksum"), "{said}");
    assert_eq!(run(&["restore", "--data", &at("third"), &at("copy.db")]).0, Some(1));
}
