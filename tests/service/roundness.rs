//! Measured sections over HTTP: the reference circles of the metrology institute, and as many points as the contract allows.
#![allow(clippy::print_stdout, reason = "what is absent is said, and how near the circles come")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use precut::registry::Registry;
use serde_json::{Value, json};

use crate::support::Server;

async fn server() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

/// Asks, and waits where the answer is a job's.
async fn solve(server: &Server, body: String) -> Value {
    let request = server.post_to("/v1/roundness-evaluation", body).header("prefer", "wait=60");
    let response = request.send().await.unwrap();
    let status = response.status();
    let answer: Value = response.json().await.unwrap();
    assert_eq!(status, 200, "{answer}");
    answer["result"].clone()
}

/// The institute's point sets; `None`, after saying so, where they do not lie beside the project.
fn institute() -> Option<PathBuf> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/reference/nist/circle2d_reference_pairs.json");
    if file.is_file() {
        return Some(file);
    }
    assert!(std::env::var_os("CI").is_none(), "{} is absent", file.display());
    println!("skipped: {} is absent", file.display());
    None
}

#[tokio::test]
async fn the_reference_circles_of_the_institute_come_out() {
    let Some(file) = institute() else { return };
    let sets: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    let sets = sets["sets"].as_array().unwrap();
    assert_eq!(sets.len(), 30);
    let server = server().await;
    let number = |value: &Value| value.as_str().unwrap().parse::<f64>().unwrap();
    let mut largest_mm = 0.0_f64;
    for set in sets {
        let points = set["points"].as_array().unwrap();
        let rows: Vec<Value> = points.iter().map(|p| json!({ "x_mm": p[0], "y_mm": p[1] })).collect();
        let found = solve(&server, json!({ "points": rows, "filter": { "kind": "none" } }).to_string()).await;
        let circle = &found["measured"]["least_squares"];
        let got = |name: &str| circle[name].as_f64().unwrap();
        let expected = &set["nist_least_squares"];
        let centre = [number(&expected["center"][0]), number(&expected["center"][1])];
        let off_mm = (got("centre_x_mm") - centre[0]).hypot(got("centre_y_mm") - centre[1]);
        let size_mm = (2.0 * got("radius_mm") - number(&expected["diameter"])).abs();
        largest_mm = largest_mm.max(off_mm).max(size_mm);
        assert!(off_mm.max(size_mm) < 1e-11, "{}: {off_mm:e} {size_mm:e}", set["id"]);
    }
    println!("largest error of centre or diameter: {largest_mm:e} mm");
    server.stop().await;
}

/// 200,000 rows as JSON, as the contract says.
#[tokio::test]
async fn as_many_points_as_the_contract_allows_are_taken_as_json() {
    const POINTS: u32 = 200_000;
    let mut rows = String::new();
    for i in 0..POINTS {
        let angle = 360.0 * f64::from(i) / f64::from(POINTS);
        let radius = 30.0 + 0.003 * (5.0 * angle.to_radians()).cos();
        let comma = if i == 0 { "" } else { "," };
        write!(rows, "{comma}{{\"angle_deg\":{angle:.6},\"radius_mm\":{radius:.8}}}").unwrap();
    }
    let server = server().await;
    let found = solve(&server, format!("{{\"radii\":[{rows}]}}")).await;
    assert_eq!(found["data"]["points"], POINTS);
    assert_eq!(found["data"]["repairs"], json!([]));
    // Five lobes of 3 um; radii are written to 0.01 nm.
    assert!(
        (found["roundness_um"].as_f64().unwrap() - 6.0 * 2f64.powf(-0.01)).abs() < 0.03,
        "{}",
        found["roundness_um"]
    );
    server.stop().await;
}
