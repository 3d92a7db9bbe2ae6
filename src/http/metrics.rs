//! Figures for Prometheus.

use std::collections::HashMap;
use std::sync::{OnceLock, RwLock};
use std::time::Duration;

use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{Method, StatusCode};
use axum::response::IntoResponse;
use metrics::{Counter, Histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};

use super::App;
use super::gate::method_label;
use crate::registry::Registry;

/// Upper edges of the latency classes, s: from an answer out of memory to a slow one.
const LATENCY_S: [f64; 14] =
    [0.000_1, 0.000_25, 0.000_5, 0.001, 0.002_5, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 2.5, 10.0];
/// Upper edges of the classes of a job's computation, s: up to the largest that is taken by default, and beyond.
const JOB_S: [f64; 12] = [0.01, 0.1, 0.5, 1.0, 5.0, 15.0, 60.0, 300.0, 900.0, 1800.0, 3600.0, 14_400.0];

const JOB: &str = "/v1/jobs/{id}";
const JOB_RESULT: &str = "/v1/jobs/{id}/result";
const JOB_INPUT: &str = "/v1/jobs/{id}/job";
const JOB_EVENTS: &str = "/v1/jobs/{id}/events";
const MODEL: &str = "/v1/models/{name}";
const MODEL_COMPARISON: &str = "/v1/models/{name}/comparison";
const PROCESS: &str = "/v1/processes/{name}";
const PROCESS_PARTS: &str = "/v1/processes/{name}/parts";
const PROCESS_PART: &str = "/v1/processes/{name}/parts/{part}";
const PROCESS_CHANGE: &str = "/v1/processes/{name}/changes/{id}";
const PROCESS_MORE: &str = "/v1/processes/{name}/{what}";
const RECORD: &str = "/v1/{kind}/{name}";
const RECORD_COMPARISON: &str = "/v1/{kind}/{name}/comparison";
const RESULT: &str = "/v1/results/{key}";
const RESULT_FIGURES: &str = "/v1/results/{key}/figures";
const RESULT_TABLES: &str = "/v1/results/{key}/tables";
const RESULT_JOB: &str = "/v1/results/{key}/job";
const RESULT_JOB_AT: &str = "/v1/results/{key}/job_at";
const RESULT_PROVENANCE: &str = "/v1/results/{key}/provenance";

/// Addresses with a variable part, as they are counted.
const PATTERNS: [(&str, &str); 28] = [
    ("/v1/jobs/", JOB),
    ("/v1/jobs/", JOB_RESULT),
    ("/v1/jobs/", JOB_INPUT),
    ("/v1/jobs/", JOB_EVENTS),
    ("/v1/models/", MODEL),
    ("/v1/models/", MODEL_COMPARISON),
    ("/v1/processes/", PROCESS),
    ("/v1/processes/", PROCESS_PARTS),
    ("/v1/processes/", PROCESS_PART),
    ("/v1/processes/", PROCESS_CHANGE),
    ("/v1/processes/", PROCESS_MORE),
    ("/v1/results/", RESULT),
    ("/v1/results/", RESULT_FIGURES),
    ("/v1/results/", RESULT_TABLES),
    ("/v1/results/", RESULT_JOB),
    ("/v1/results/", RESULT_JOB_AT),
    ("/v1/results/", RESULT_PROVENANCE),
    ("/v1/calculators/", "/v1/calculators/{id}"),
    ("/v1/machines/", RECORD),
    ("/v1/machines/", RECORD_COMPARISON),
    ("/v1/tools/", RECORD),
    ("/v1/tools/", RECORD_COMPARISON),
    ("/v1/materials/", RECORD),
    ("/v1/materials/", RECORD_COMPARISON),
    ("/v1/", "/v1/{calculator}"),
    ("/problems/", "/problems/{code}"),
    ("/docs/", "/docs/{file}"),
    ("/ui/", "/ui/{version}/{file}"),
];

/// Addresses without one, besides the calculators'.
const PLAIN: [&str; 19] = [
    "/",
    "/docs",
    "/openapi.json",
    "/health/live",
    "/health/ready",
    "/metrics",
    "/v1/calculators",
    "/v1/jobs",
    "/v1/processes",
    "/v1/models",
    "/v1/results",
    "/v1/machines",
    "/v1/tools",
    "/v1/materials",
    "/v1/tools/parse",
    "/v1/library/import",
    "/v1/library/export",
    "/v1/studies",
    "other",
];

/// What the service counts of itself. Addresses are labels by their pattern: a client cannot invent new ones.
pub(super) struct Metrics {
    handle: PrometheusHandle,
    routes: HashMap<String, Route>,
    /// One counter per route, method and status, made when first needed.
    requests: RwLock<HashMap<(Route, &'static str, u16), Counter>>,
    names: Vec<String>,
    latency: Vec<Histogram>,
}

/// A pattern of addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Route(usize);

impl Metrics {
    pub(super) fn new(registry: &Registry) -> Self {
        let handle = recorder().clone();
        let rooms = registry.entries().iter().map(|entry| format!("/v1/{}", entry.meta().id));
        let names: Vec<String> = PLAIN
            .iter()
            .chain(PATTERNS.iter().map(|(_, name)| name))
            .map(|name| (*name).to_owned())
            .chain(rooms)
            .collect();
        let routes = names.iter().enumerate().map(|(index, name)| (name.clone(), Route(index))).collect();
        let latency = names
            .iter()
            .map(|name| metrics::histogram!("http_request_duration_seconds", "route" => name.clone()))
            .collect();
        Self { handle, routes, requests: RwLock::default(), names, latency }
    }

    /// The pattern that a path belongs to.
    pub(super) fn route(&self, path: &str) -> Route {
        let known = |name: &str| self.routes.get(name).copied();
        known(path)
            .filter(|_| !path.contains('{'))
            .or_else(|| known(pattern(path)?))
            .or_else(|| known("other"))
            .unwrap_or(Route(0))
    }

    /// Counts an answer.
    pub(super) fn answered(&self, route: Route, method: &Method, status: StatusCode, took: Duration) {
        self.latency[route.0].record(took.as_secs_f64());
        let at = (route, method_label(method), status.as_u16());
        let known = self.requests.read().unwrap_or_else(std::sync::PoisonError::into_inner).get(&at).cloned();
        let counter = known.unwrap_or_else(|| self.counter(at));
        counter.increment(1);
    }

    fn counter(&self, at: (Route, &'static str, u16)) -> Counter {
        let mut requests = self.requests.write().unwrap_or_else(std::sync::PoisonError::into_inner);
        requests
            .entry(at)
            .or_insert_with(|| {
                metrics::counter!(
                    "http_requests_total",
                    "route" => self.names[at.0.0].clone(), "method" => at.1, "status" => at.2.to_string()
                )
            })
            .clone()
    }

    /// To be called every few seconds: folds the samples taken since into the classes.
    pub(super) fn upkeep(&self) {
        self.handle.run_upkeep();
    }
}

/// The pattern of an address with a variable part.
fn pattern(path: &str) -> Option<&'static str> {
    if path.starts_with("/v1/jobs/") {
        let part = path.rsplit('/').next();
        return Some(match part {
            Some("result") => JOB_RESULT,
            Some("job") => JOB_INPUT,
            Some("events") => JOB_EVENTS,
            _ => JOB,
        });
    }
    if path.starts_with("/v1/models/") {
        return Some(if path.ends_with("/comparison") { MODEL_COMPARISON } else { MODEL });
    }
    if let Some(rest) = path.strip_prefix("/v1/processes/") {
        return Some(match rest.split('/').collect::<Vec<_>>()[..] {
            [_] => PROCESS,
            [_, "parts"] => PROCESS_PARTS,
            [_, "parts", _] => PROCESS_PART,
            [_, "changes", _] => PROCESS_CHANGE,
            _ => PROCESS_MORE,
        });
    }
    let is_record = ["/v1/machines/", "/v1/tools/", "/v1/materials/"].iter().any(|folder| path.starts_with(folder));
    if is_record && path != "/v1/tools/parse" {
        return Some(if path.ends_with("/comparison") { RECORD_COMPARISON } else { RECORD });
    }
    if path.starts_with("/v1/results/") {
        let part = path.rsplit('/').next();
        return Some(match part {
            Some("figures") => RESULT_FIGURES,
            Some("tables") => RESULT_TABLES,
            Some("job") => RESULT_JOB,
            Some("job_at") => RESULT_JOB_AT,
            Some("provenance") => RESULT_PROVENANCE,
            _ => RESULT,
        });
    }
    PATTERNS.iter().find(|(prefix, _)| path.starts_with(prefix)).map(|&(_, name)| name)
}

/// How often answers came from the cache, per calculator.
pub(super) struct CacheCounters {
    pub(super) hit: Counter,
    pub(super) miss: Counter,
}

impl CacheCounters {
    pub(super) fn new(calculator: &'static str) -> Self {
        let counter = |result| metrics::counter!("precut_answers_total", "calculator" => calculator, "cache" => result);
        // Registered only once the recorder is there: see `Metrics::new`.
        Self { hit: counter("hit"), miss: counter("miss") }
    }
}

/// `GET /metrics`
pub(super) async fn get(State(app): State<App>) -> impl IntoResponse {
    #[allow(clippy::cast_precision_loss)] // counts far below 2^53
    metrics::gauge!("http_requests_in_flight").set(app.in_flight.load(std::sync::atomic::Ordering::Relaxed) as f64);
    metrics::gauge!("precut_bodies_bytes").set(app.engine.bodies().used() as f64);
    of_the_process();
    let text = app.metrics.handle.render();
    ([(CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8"), (CACHE_CONTROL, "no-store")], text)
}

/// Memory and open files of the process, where the system tells them.
fn of_the_process() {
    /// Pages of memory are of this size wherever the system tells them this way.
    const PAGE_BYTES: f64 = 4096.0;
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    if let Some(pages) = pages.and_then(|sizes| sizes.split(' ').nth(1)?.parse::<f64>().ok()) {
        metrics::gauge!("process_resident_memory_bytes").set(pages * PAGE_BYTES);
    }
    if let Ok(open) = std::fs::read_dir("/proc/self/fd") {
        #[allow(clippy::cast_precision_loss)] // a count of files
        metrics::gauge!("process_open_fds").set(open.count() as f64);
    }
}

/// The recorder of the process: the `metrics` facade knows only one.
fn recorder() -> &'static PrometheusHandle {
    static RECORDER: OnceLock<PrometheusHandle> = OnceLock::new();
    RECORDER.get_or_init(|| {
        // Of `precut_job_seconds` and `precut_job_wait_seconds`.
        let of_jobs = Matcher::Prefix("precut_job_".to_owned());
        let builder = PrometheusBuilder::new()
            .set_buckets(&LATENCY_S)
            .and_then(|builder| builder.set_buckets_for_metric(of_jobs, &JOB_S))
            .expect("there are classes");
        let recorder = builder.build_recorder();
        let handle = recorder.handle();
        if metrics::set_global_recorder(recorder).is_err() {
            tracing::warn!("another recorder of metrics is installed: /metrics stays empty");
        }
        metrics::describe_counter!("http_requests_total", "Requests answered, by route, method and status.");
        metrics::describe_histogram!(
            "http_request_duration_seconds",
            metrics::Unit::Seconds,
            "Time from a request's header to its answer's header, by route."
        );
        metrics::describe_gauge!("http_requests_in_flight", "Requests in work.");
        metrics::describe_counter!("precut_answers_total", "Answers by calculator, from the cache (hit) or not.");
        metrics::describe_counter!("precut_results_evicted_total", "Kept results forgotten to make room.");
        metrics::describe_counter!("precut_cache_hits_total", "Answers found, by tier: in memory or in the store.");
        metrics::describe_counter!(
            "precut_calculations_total",
            "Calculations by calculator and outcome: ok, no_answer (the job has none), cancelled, error (a fault of ours)."
        );
        metrics::describe_histogram!(
            "precut_calculation_seconds",
            metrics::Unit::Seconds,
            "Time that a calculation took on its core, by calculator."
        );
        metrics::describe_counter!("precut_busy_total", "Jobs refused because no core became free in time.");
        metrics::describe_counter!("precut_panics_total", "Calculations that crashed. Each is a fault of ours.");
        metrics::describe_counter!("precut_store_failures_total", "Failures of the store, by operation.");
        metrics::describe_counter!("precut_jobs_accepted_total", "Jobs put on record, by calculator.");
        metrics::describe_counter!("precut_jobs_total", "Computations for jobs that ended, by calculator and outcome.");
        metrics::describe_histogram!(
            "precut_job_seconds",
            metrics::Unit::Seconds,
            "Time that a job's computation took, by calculator."
        );
        metrics::describe_histogram!(
            "precut_job_wait_seconds",
            metrics::Unit::Seconds,
            "Time from when a job was accepted to its beginning, by calculator."
        );
        metrics::describe_gauge!("precut_job_oldest_seconds", "How long the job has waited that has waited longest.");
        metrics::describe_gauge!("precut_store_bytes", "What the database takes of the disk.");
        metrics::describe_counter!("precut_owner_jobs_total", "Jobs put on record, by owner of keys.");
        metrics::describe_counter!(
            "precut_owner_work_milliseconds_total",
            "Work by owner of keys: what jobs took here, what direct answers were estimated at."
        );
        metrics::describe_gauge!("precut_owner_kept_bytes", "Jobs, their results and models that are kept, by owner of keys.");
        metrics::describe_gauge!("precut_jobs", "Jobs by state: queued, running.");
        metrics::describe_counter!(
            "precut_jobs_shards_total",
            "Shards of large studies that this process began to compute."
        );
        metrics::describe_counter!(
            "precut_callbacks_total",
            "Tries to tell somebody that a job is over, by outcome: delivered, failed, given_up."
        );
        metrics::describe_gauge!("precut_callbacks_pending", "Callbacks that are to be delivered.");
        metrics::describe_counter!("precut_queue_full_total", "Jobs refused because too many waited.");
        metrics::describe_counter!("precut_jobs_poisonous_total", "Jobs given up: they ended the process each time.");
        metrics::describe_gauge!("precut_bodies_bytes", "Memory of bodies in work, of limits.bodies_bytes.");
        metrics::describe_gauge!("process_resident_memory_bytes", "Memory of the process that is in use.");
        metrics::describe_gauge!("process_open_fds", "Files and connections that the process has open.");
        metrics::describe_gauge!("precut_build_info", "Always 1; the version is its label.");
        metrics::gauge!("precut_build_info", "version" => env!("CARGO_PKG_VERSION")).set(1.0);
        handle
    })
}
