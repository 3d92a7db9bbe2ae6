//! Whether the service lives, and whether it serves.

use axum::extract::State;
use axum::http::header::CACHE_CONTROL;
use axum::response::{IntoResponse, Json};
use serde::Serialize;
use utoipa::ToSchema;

use super::App;
use super::problem::Problem;

/// State of the service.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Health {
    /// `live` or `ready`.
    #[schema(example = "ready")]
    status: HealthStatus,
    /// Version of the engine.
    #[schema(example = "0.1.0")]
    engine: &'static str,
}

/// How well the service is.
#[derive(Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum HealthStatus {
    /// The process answers.
    Live,
    /// It takes work.
    Ready,
}

/// `GET /health/live`: the process answers. Restart it if it does not.
pub(super) async fn live() -> impl IntoResponse {
    healthy(HealthStatus::Live)
}

/// `GET /health/ready`: the store serves and nobody is shutting it down. Send no work if not.
pub(super) async fn ready(State(app): State<App>) -> Result<impl IntoResponse, Problem> {
    if app.is_stopping() {
        return Err(Problem::shutting_down());
    }
    app.engine.ready().await?;
    Ok(healthy(HealthStatus::Ready))
}

fn healthy(status: HealthStatus) -> impl IntoResponse {
    ([(CACHE_CONTROL, "no-store")], Json(Health { status, engine: env!("CARGO_PKG_VERSION") }))
}
