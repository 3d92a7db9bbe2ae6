//! The problems that the service can report: their codes are part of the contract.

use axum::http::StatusCode;

/// Every problem code that is not a calculator's own, with its status. Title, detail and help stand in the texts
/// under `problem`, and a test holds that none is missing.
pub const CODES: &[(&str, u16)] = &[
    // The body is no JSON (the engine's reader).
    ("bad_syntax", 400),
    ("duplicate_key", 400),
    ("empty_body", 400),
    ("integer_too_large", 400),
    ("nested_too_deeply", 400),
    ("number_out_of_range", 400),
    ("number_too_long", 400),
    ("trailing_bytes", 400),
    ("unexpected_end", 400),
    // The request is at fault.
    ("bad_idempotency_key", 400),
    ("bad_key", 400),
    ("bad_multipart", 400),
    ("bad_query", 400),
    ("bad_request", 400),
    ("incomplete_body", 400),
    ("missing_job_part", 400),
    ("unauthorized", 401),
    ("forbidden", 403),
    ("not_found", 404),
    ("unknown_calculator", 404),
    ("unknown_change", 404),
    ("unknown_figure", 404),
    ("unknown_job", 404),
    ("unknown_machine", 404),
    ("unknown_material", 404),
    ("unknown_model", 404),
    ("unknown_part", 404),
    ("unknown_problem", 404),
    ("unknown_process", 404),
    ("unknown_process_part", 404),
    ("unknown_result", 404),
    ("unknown_table", 404),
    ("unknown_tool", 404),
    ("method_not_allowed", 405),
    ("not_acceptable", 406),
    ("timeout", 408),
    ("action_is_call_person", 409),
    ("job_cancelled", 409),
    ("job_not_finished", 409),
    ("model_name_taken", 409),
    ("model_of_process", 409),
    ("name_is_built_in", 409),
    ("part_number_taken", 409),
    ("process_exists", 409),
    ("job_expired", 410),
    ("outdated_result", 410),
    ("model_exists", 412),
    ("precondition_failed", 412),
    ("record_exists", 412),
    ("body_too_large", 413),
    ("record_too_large", 413),
    ("uri_too_long", 414),
    ("unsupported_media_type", 415),
    ("precondition_required", 428),
    // The job is at fault, or has no answer.
    ("bad_callback", 422),
    ("deadline_exceeded", 422),
    ("idempotency_key_reused", 422),
    ("infeasible", 422),
    ("invalid_job", 422),
    ("invalid_model", 422),
    ("invalid_process", 422),
    ("invalid_record", 422),
    ("not_converged", 422),
    ("out_of_model", 422),
    ("program_not_read", 422),
    ("too_expensive", 422),
    ("workbook_too_large", 422),
    ("kept_quota", 429),
    ("too_many_requests", 429),
    ("too_many_streams", 429),
    ("work_quota", 429),
    ("header_too_large", 431),
    // The service is.
    ("crashed", 500),
    ("crashed_repeatedly", 500),
    ("internal", 500),
    ("busy", 503),
    ("overloaded", 503),
    ("queue_full", 503),
    ("shutting_down", 503),
    ("store_failed", 503),
    ("disk_full", 507),
    ("library_full", 507),
];

/// Status of a problem that is not a calculator's own.
pub(super) fn status(code: &str) -> Option<u16> {
    CODES.iter().find(|(known, _)| *known == code).map(|&(_, status)| status)
}

/// Code of an error that the framework made by itself.
pub(super) fn of_status(status: StatusCode) -> &'static str {
    match status.as_u16() {
        401 => "unauthorized",
        404 => "not_found",
        405 => "method_not_allowed",
        406 => "not_acceptable",
        408 => "timeout",
        413 => "body_too_large",
        414 => "uri_too_long",
        415 => "unsupported_media_type",
        429 => "too_many_requests",
        431 => "header_too_large",
        503 => "overloaded",
        500..=599 => "internal",
        _ => "bad_request",
    }
}
