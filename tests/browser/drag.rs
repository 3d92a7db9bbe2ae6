//! How soon the picture follows the hand: a measurement, not a test.
//! `PRECUT_MEASURED=target/release/precut cargo test --test browser how_soon -- --ignored --nocapture` prints a table;
//! `docs/workbench.md` has its figures.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::chromium::Page;
use crate::{SETTLED, TURN};

/// Between two moves of the hand.
const PAUSE: Duration = Duration::from_millis(100);
/// Moves of one pull.
const MOVES: u32 = 10;
/// Pulls of one place.
const PULLS: u32 = 5;

/// Notes every move of the hand, and when the picture of the place that it went to was painted: a frame after the drawing
/// changed. Tests stop the clock of the page; here is the one behind it.
const WATCH: &str = r"(() => {
    const now = () => Performance.prototype.now.call(performance);
    const seen = (window.seen = { moves: [], pictures: [] });
    addEventListener('pointermove', event => event.buttons && seen.moves.push(event.timeStamp), true);
    let waits = false;
    new MutationObserver(() => {
        if (waits) return;
        waits = true;
        requestAnimationFrame(() => {
            const { port1, port2 } = new MessageChannel();
            port1.onmessage = () => { waits = false; seen.pictures.push(now()); };
            port2.postMessage(0);
        });
    }).observe(document.querySelector('.picture.main'), { subtree: true, attributes: true, attributeFilter: ['d'] });
    performance.setResourceTimingBufferSize(10000);
})()";
/// Requests since the last look: from the first byte sent to the last one read, and the part of it that the service says, ms.
const REQUESTS: &str = "(() => { \
    const of = performance.getEntriesByType('resource').filter(({ name }) => name.includes('include=figures')); \
    performance.clearResourceTimings(); \
    return of.map(one => [one.responseEnd - one.requestStart, one.serverTiming.reduce((sum, { duration }) => sum + duration, 0)]) })()";

/// CPU time that the page's thread took, s.
fn page_cpu_s(page: &mut Page) -> f64 {
    let metrics = page.call("Performance.getMetrics", json!({}));
    let named = |metric: &&Value| metric["name"] == "TaskDuration";
    metrics["metrics"].as_array().unwrap().iter().find(named).unwrap()["value"].as_f64().unwrap()
}

/// A service in a process of its own, so that its CPU time is its own.
struct Measured {
    process: Child,
    address: String,
    _data: tempfile::TempDir,
}

impl Measured {
    fn start() -> Self {
        let program = std::env::var_os("PRECUT_MEASURED").unwrap_or_else(|| env!("CARGO_BIN_EXE_precut").into());
        let data = tempfile::tempdir().unwrap();
        let mut process = Command::new(program)
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap()).lines().map_while(Result::ok);
        let address = lines.map(|line| line.trim().to_owned()).find(|line| line.starts_with("http://")).unwrap();
        Self { process, address, _data: data }
    }

    /// CPU time so far, s.
    fn cpu_s(&self) -> f64 {
        /// Ticks of `/proc` in a second.
        const TICKS: f64 = 100.0;
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.process.id())).unwrap();
        let behind_name = stat.rsplit_once(')').unwrap().1;
        let fields: Vec<&str> = behind_name.split_whitespace().collect();
        (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / TICKS
    }
}

impl Drop for Measured {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn quantile(sample: &[f64], share: f64) -> f64 {
    let mut sorted = sample.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(f64::NAN)
}

#[test]
#[ignore = "a measurement, for a machine that is quiet"]
fn how_soon_the_picture_follows_the_hand() {
    eprintln!(
        "{:48} {:>22} {:>20} {:>8} {:>17} {:>16}",
        "", "first change, ms", "each move, ms", "pictures", "request (service)", "CPU/picture, ms"
    );
    // The first move is longer than a stop holds a handle.
    for (place, selector, (dx, dy)) in [
        ("deflection-compensation?example=stepped_with_rest", ".grip[data-name=handle_shoulder]", (9.0, 0.0)),
        ("feed-schedule", ".grip[data-name=handle_zone]", (9.0, 0.0)),
        ("fixture-stability?example=lobes", ".handle", (4.0, 2.0)),
        ("ring-roundness?example=clear_start", ".grip.round", (3.0, 3.0)),
    ] {
        let _turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let Some(mut page) = Page::new() else { return };
        let service = Measured::start();
        page.call("Performance.enable", json!({"timeDomain": "threadTicks"}));
        page.open(&format!("{}#/{place}", service.address));
        page.until(SETTLED);
        page.evaluate(WATCH);
        let (mut first, mut each, mut requests) = (Vec::new(), Vec::new(), Vec::new());
        let (mut pictures, mut moves, mut cpu) = (0, 0, [0.0, 0.0]);
        for pull in 0..PULLS {
            page.until(SETTLED);
            page.evaluate(REQUESTS);
            page.evaluate("seen.moves = [], seen.pictures = []");
            let (x, y) = page.middle(selector);
            let sign = if pull % 2 == 0 { 1.0 } else { -1.0 };
            page.point((x, y));
            page.press_at((x, y));
            let before = [page_cpu_s(&mut page), service.cpu_s()];
            for step in 1..=MOVES {
                let begun = Instant::now();
                let by = sign * f64::from(step);
                page.pull((x + by * dx, y + by * dy));
                thread::sleep(PAUSE.saturating_sub(begun.elapsed()));
            }
            thread::sleep(2 * PAUSE);
            page.until(SETTLED);
            let after = [page_cpu_s(&mut page), service.cpu_s()];
            let seen = page.evaluate("seen");
            page.let_go((x + sign * f64::from(MOVES) * dx, y + sign * f64::from(MOVES) * dy));
            cpu = [0, 1].map(|of| cpu[of] + after[of] - before[of]);
            let (moved, painted) = (numbers(&seen["moves"]), numbers(&seen["pictures"]));
            // Where pictures come within the pause, the next one after a move is that of the move; where they do not, there are
            // fewer pictures than moves.
            first.extend(painted.first().zip(moved.first()).map(|(picture, began)| picture - began));
            each.extend(moved.iter().filter_map(|at| painted.iter().find(|picture| *picture > at).map(|it| it - at)));
            pictures += painted.len();
            moves += moved.len();
            for one in page.evaluate(REQUESTS).as_array().unwrap() {
                requests.push(numbers(one));
            }
        }
        let of = |index: usize| requests.iter().map(|one| one[index]).collect::<Vec<_>>();
        let count = pictures as f64;
        eprintln!(
            "{place:48} {:>22} {:>20} {:>8} {:>17} {:>16}",
            format!("{:.0} ({:.0} at most)", quantile(&first, 0.5), quantile(&first, 1.0)),
            format!("{:.0} ({:.0} at 95 %)", quantile(&each, 0.5), quantile(&each, 0.95)),
            format!("{pictures}/{moves}"),
            format!("{:.0} ({:.0})", quantile(&of(0), 0.5), quantile(&of(1), 0.5)),
            format!("{:.0} + {:.0}", 1000.0 * cpu[0] / count, 1000.0 * cpu[1] / count),
        );
        page.assert_calm();
    }
}
