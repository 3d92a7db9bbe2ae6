//! Clients that are slow, silent or gone.

use std::io::{Read, Write};
use std::net::TcpStream;

use serde_json::json;

use crate::watch::{PATIENCE, Service, until};

fn connect(service: &Service) -> TcpStream {
    let stream = TcpStream::connect(service.process.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream
}

/// Everything until the service closes the connection; empty where it says nothing.
fn rest(mut stream: TcpStream) -> String {
    let mut said = Vec::new();
    let _ = stream.read_to_end(&mut said);
    String::from_utf8_lossy(&said).into_owned()
}

#[tokio::test]
async fn slow_silent_and_departed_clients_hold_nobody_up() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_LIMITS_HEADER_TIMEOUT_S", "1"), ("PRECUT_LIMITS_BODY_TIMEOUT_S", "1")];
    let service = Service::start(folder.path(), &settings).await;
    // Half-open: connected, and nothing comes.
    let silent: Vec<TcpStream> = (0..50).map(|_| connect(&service)).collect();
    // Half a header.
    let half: Vec<TcpStream> = (0..50)
        .map(|_| {
            let mut stream = connect(&service);
            stream.write_all(b"POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-").unwrap();
            stream
        })
        .collect();
    // A body that does not come.
    let slow: Vec<TcpStream> = (0..50)
        .map(|_| {
            let mut stream = connect(&service);
            stream
                .write_all(
                    b"POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n\
                      Content-Length: 500\r\n\r\n{\"length_mm\": ",
                )
                .unwrap();
            stream
        })
        .collect();
    // Others are served meanwhile.
    for length in 100..120 {
        let answer = service.post(&json!({"length_mm": length, "load_n": 1})).send().await.unwrap();
        assert_eq!(answer.status(), 200);
    }
    let counts = tokio::task::spawn_blocking(move || {
        let refused = slow.into_iter().map(rest).filter(|said| said.starts_with("HTTP/1.1 408 ")).count();
        let closed = silent.into_iter().chain(half).map(rest).filter(|said| !said.contains(" 200 ")).count();
        (refused, closed)
    })
    .await
    .unwrap();
    assert_eq!(counts, (50, 100));
    println!("50 slow bodies: 408; 100 silent or half connections: closed; 20 others served meanwhile");
    service.stop();
}

#[tokio::test]
async fn a_client_that_goes_away_takes_its_calculation_along_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_LIMITS_DIRECT_MS", "100000"), ("PRECUT_CPU", "8")];
    let service = Service::start(folder.path(), &settings).await;
    for length in 0..5 {
        let job = json!({"length_mm": 100 + length, "load_n": 1, "duration_ms": 60_000}).to_string();
        let mut stream = connect(&service);
        let head = format!(
            "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
            job.len()
        );
        stream.write_all((head + &job).as_bytes()).unwrap();
        until("the calculation to begin", async || {
            (service.figure("http_requests_in_flight", "").await >= 2.0).then_some(())
        })
        .await;
        drop(stream);
        until("the calculation to be given up", async || {
            (service.figure("http_requests_in_flight", "").await < 2.0).then_some(())
        })
        .await;
    }
    until("all calculations to be given up", async || {
        let given_up = service.figure("precut_calculations_total", "\"cancelled\"").await;
        (given_up >= 5.0).then_some(())
    })
    .await;
    let answer = service.post(&json!({"length_mm": 100, "load_n": 1})).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    // A job outlives who sent it.
    let address = service.accepted(&json!({"length_mm": 300, "load_n": 1, "duration_ms": 300})).await;
    assert_eq!(service.over(&address).await["state"], "succeeded");
    println!("5 clients gone: 5 calculations of a minute given up; a job goes on");
    service.stop();
}
