//! The service: HTTP into calls of the engine, and its answers and errors into HTTP. No physics, no SQL.

mod answer;
pub mod auth;
mod body;
mod calculators;
pub mod callbacks;
mod codes;
mod document;
mod events;
mod gate;
mod health;
mod in_place;
mod jobs;
mod library;
mod metrics;
mod models;
mod negotiate;
pub mod openapi;
mod pages;
mod parts;
mod prefer;
mod problem;
mod processes;
mod provenance;
mod query;
mod quota;
mod rate;
mod records;
mod report;
mod results;
mod server;
mod workbench;

use std::net::IpAddr;
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use axum::Router;
use axum::body::Body;
use axum::extract::Path;
use axum::http::{HeaderName, Request, StatusCode, Uri};
use axum::routing::{any, get, post};
use bytes::Bytes;
use http_body_util::BodyExt;
use tower::ServiceExt;
use tower_http::cors::{AllowOrigin, CorsLayer};

use precut_library::Kind;

use crate::config::{self, Config, Limits, Role};
use crate::engine::{Engine, Error};

pub use answer::written;
pub use codes::CODES;
pub use library::{codes_said, record_said};
pub use negotiate::Media;
#[cfg(test)]
pub(crate) use pages::DESCRIPTION;
pub use problem::{Problem, ProblemDocument};
pub use server::serve;

/// Says whether an answer came from the cache: `hit` or `miss`.
const CACHE_STATE: HeaderName = HeaderName::from_static("precut-cache");

/// The service with all that its handlers share. Cheap to clone.
#[derive(Clone)]
pub struct App(Arc<Shared>);

/// What all requests share.
pub struct Shared {
    engine: Engine,
    limits: Limits,
    origins: Vec<String>,
    keys: auth::Keys,
    callbacks: callbacks::Callbacks,
    rate: Option<rate::RateLimiter>,
    metrics: metrics::Metrics,
    rooms: Vec<Arc<calculators::Room>>,
    documents: document::Documents,
    streams: Arc<events::Streams>,
    in_flight: AtomicUsize,
    waiting: AtomicUsize,
    stopping: AtomicBool,
    role: Role,
}

impl Deref for App {
    type Target = Shared;
    fn deref(&self) -> &Shared {
        &self.0
    }
}

impl App {
    /// The service in front of `engine`.
    pub fn new(engine: Engine, config: &Config) -> Self {
        // The recorder of metrics comes first: counters made before it count nothing.
        let metrics = metrics::Metrics::new(engine.registry());
        let entries = engine.registry().entries().iter().chain([engine.studies()]);
        let rooms: Vec<_> = entries.map(calculators::Room::new).collect();
        let documents = document::Documents::new(engine.registry());
        Self(Arc::new(Shared {
            limits: config.limits.clone(),
            origins: config.cors.origins.clone(),
            keys: auth::Keys::new(&config.auth),
            callbacks: callbacks::Callbacks::new(&config.callbacks),
            rate: rate::RateLimiter::new(config.limits.requests_per_s, config.limits.burst),
            metrics,
            rooms: rooms.into_iter().map(Arc::new).collect(),
            documents,
            streams: Arc::new(events::Streams::new(config.jobs.streams)),
            in_flight: AtomicUsize::new(0),
            waiting: AtomicUsize::new(0),
            stopping: AtomicBool::new(false),
            role: config.role,
            engine,
        }))
    }

    /// From now on the service is not ready and takes no more work.
    pub fn stop(&self) {
        self.stopping.store(true, Ordering::Relaxed);
        self.engine.stop_jobs();
    }

    /// From now on these keys open the service, unless that would open to everybody what keys guard; whether they do.
    pub fn replace_keys(&self, auth: &config::Auth) -> bool {
        self.keys.replace(auth)
    }

    fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}

/// Who is at the other end of the connection.
#[derive(Clone)]
struct Peer {
    ip: IpAddr,
    unread: body::Unread,
}

/// Every route behind the gate.
pub fn router(app: &App) -> Router {
    // Who only runs jobs is asked how it is, and nothing else.
    if app.role == Role::Worker { admin_router(app) } else { gated(app, routes(app, health())) }
}

/// The answer to one request, without a connection: for who has the service in the same program.
pub async fn answer_to(app: &App, request: Request<Bytes>) -> (StatusCode, Bytes) {
    let Ok(response) = router(app).oneshot(request.map(Body::from)).await;
    let status = response.status();
    // What is made in memory has no end that fails.
    let body = response.into_body().collect().await.map(http_body_util::Collected::to_bytes).unwrap_or_default();
    (status, body)
}

/// Health and metrics alone, behind the same gate.
fn admin_router(app: &App) -> Router {
    gated(app, health())
}

fn health() -> Router<App> {
    Router::new()
        .route("/health/live", get(health::live))
        .route("/health/ready", get(health::ready))
        .route("/metrics", get(metrics::get))
}

fn gated(app: &App, routes: Router<App>) -> Router {
    let router = routes
        .fallback(not_found)
        .layer(axum::middleware::from_fn_with_state(app.clone(), gate::gate))
        .with_state(app.clone());
    match cors(&app.origins) {
        Some(cors) => router.layer(cors),
        None => router,
    }
}

fn routes(app: &App, health: Router<App>) -> Router<App> {
    let mut router = health
        .route("/", get(pages::landing))
        .route("/ui/{version}/{*file}", get(workbench::file))
        .route("/docs", get(pages::docs))
        .route("/docs/{file}", get(pages::docs_file))
        .route("/problems/{code}", get(pages::problem))
        .route("/openapi.json", get(document::openapi))
        .route("/v1/calculators", get(calculators::list))
        .route("/v1/calculators/{id}", get(calculators::describe))
        .route("/v1/jobs", get(jobs::list))
        .route("/v1/jobs/{id}", get(jobs::read).delete(jobs::cancel))
        .route("/v1/jobs/{id}/result", get(jobs::result))
        .route("/v1/jobs/{id}/job", get(jobs::input))
        .route("/v1/jobs/{id}/events", get(events::follow))
        .route("/v1/models", get(models::list))
        .route("/v1/models/{name}/comparison", get(models::compare))
        .route("/v1/models/{name}", get(models::read).put(models::store).delete(models::delete))
        .route("/v1/results", get(results::list))
        .route("/v1/results/{key}", get(results::read))
        .route("/v1/results/{key}/figures", get(parts::figures))
        .route("/v1/results/{key}/tables", get(parts::tables))
        .route("/v1/results/{key}/job", get(parts::job))
        .route("/v1/results/{key}/job_at", get(parts::job_at))
        .route("/v1/results/{key}/provenance", get(provenance::read))
        .route("/v1/library/export", get(library::export))
        .route("/v1/library/import", post(library::import))
        .route("/v1/tools/parse", post(library::parse))
        .route("/v1/{calculator}", any(unknown_calculator));
    router = router.merge(processes::routes());
    for kind in Kind::ALL {
        router = router.merge(records::routes(kind));
    }
    for room in &app.rooms {
        let handler = {
            let (app, room) = (app.clone(), room.clone());
            move |request: Request<Body>| calculators::solve(app.clone(), room.clone(), request)
        };
        router = router.route(&format!("/v1/{}", room.id()), post(handler));
    }
    router
}

async fn not_found(uri: Uri) -> Problem {
    Problem::not_found(uri.path())
}

async fn unknown_calculator(axum::extract::State(app): axum::extract::State<App>, Path(name): Path<String>) -> Problem {
    Error::unknown(app.engine.registry(), &name).into()
}

/// Nothing unless origins are configured.
fn cors(origins: &[String]) -> Option<CorsLayer> {
    use axum::http::{Method, header};
    if origins.is_empty() {
        return None;
    }
    let allowed = if origins.iter().any(|origin| origin == "*") {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(origins.iter().filter_map(|origin| origin.parse().ok()))
    };
    let request_headers = [
        header::ACCEPT_LANGUAGE,
        header::AUTHORIZATION,
        header::CONTENT_TYPE,
        header::IF_MATCH,
        header::IF_NONE_MATCH,
        events::LAST_EVENT_ID,
        prefer::IDEMPOTENCY_KEY,
        prefer::PREFER,
        gate::REQUEST_ID,
        gate::TRACEPARENT,
    ];
    let exposed = [
        header::CONTENT_LOCATION,
        header::ETAG,
        header::LOCATION,
        header::RETRY_AFTER,
        prefer::PREFERENCE_APPLIED,
        quota::RATE_LIMIT,
        quota::RATE_LIMIT_POLICY,
        CACHE_STATE,
        gate::REQUEST_ID,
    ];
    Some(
        CorsLayer::new()
            .allow_origin(allowed)
            .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE])
            .allow_headers(request_headers)
            .expose_headers(exposed)
            .max_age(std::time::Duration::from_hours(1)),
    )
}
