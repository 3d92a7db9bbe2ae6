//! The workbench: the page of the service and what belongs to it, all of it in the binary (in a debug build read from
//! the folder `ui/app`, so that a change shows at once).

use std::fmt::Write as _;

use axum::extract::Path;
use axum::http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY};
use axum::http::{HeaderMap, HeaderValue};
use axum::response::Response;

use super::document::Document;
use super::problem::Problem;
use crate::render::palette;

#[derive(rust_embed::RustEmbed)]
#[folder = "ui/app"]
struct Files;

const HTML: &str = "text/html; charset=utf-8";
const INDEX: &str = "index.html";
/// The colours of pictures, which are those of the service's own.
const PALETTE: &str = "palette.css";

/// Scripts and styles of the service alone, no inline ones; it talks to nobody else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The page. Every address in it has the version of all files, which may therefore be kept for ever.
pub(super) fn index(headers: &HeaderMap) -> Result<Response, Problem> {
    let file = Files::get(INDEX).ok_or_else(Problem::internal)?;
    let page = String::from_utf8(file.data.into_owned()).map_err(|_| Problem::internal())?;
    let version = version();
    let mut preload = String::new();
    for path in Files::iter().filter(|path| path.ends_with(".js")) {
        let _ = write!(preload, "<link rel=\"modulepreload\" href=\"/ui/{version}/{path}\">");
    }
    let page = page.replace("{version}", &version).replace("<!--preload-->", &preload);
    let mut response = Document::new(page, HTML, None).respond(headers);
    response.headers_mut().insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    Ok(response)
}

/// `GET /ui/{version}/{file}`
pub(super) async fn file(Path((asked, name)): Path<(String, String)>, headers: HeaderMap) -> Result<Response, Problem> {
    let absent = || Problem::not_found(&format!("/ui/{asked}/{name}"));
    let kind = content_type(&name).ok_or_else(absent)?;
    let content = match name.as_str() {
        PALETTE => palette().into_bytes(),
        name => Files::get(name).ok_or_else(absent)?.data.into_owned(),
    };
    let mut response = Document::new(content, kind, None).respond(&headers);
    // A page of an older version gets what there is now, and asks again the next time.
    if asked == version() {
        let for_ever = HeaderValue::from_static("public, max-age=31536000, immutable");
        response.headers_mut().insert(CACHE_CONTROL, for_ever);
    }
    Ok(response)
}

fn content_type(name: &str) -> Option<&'static str> {
    let (_, kind) = name.rsplit_once('.')?;
    Some(match kind {
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" => "application/json",
        "svg" => "image/svg+xml",
        _ => return None,
    })
}

/// Changes with any of the files.
#[cfg(not(debug_assertions))]
fn version() -> String {
    static VERSION: std::sync::LazyLock<String> = std::sync::LazyLock::new(|| {
        hashed(|name, hasher| {
            if let Some(file) = Files::get(name) {
                hasher.update(&file.metadata.sha256_hash());
            }
        })
    });
    VERSION.clone()
}

/// Changes with any of the files, also while the service runs: with the time at which one was written, as reading all of
/// them for every request takes longer than all else.
#[cfg(debug_assertions)]
fn version() -> String {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/app");
    hashed(|name, hasher| {
        let written = std::fs::metadata(folder.join(name)).and_then(|file| file.modified());
        hasher.update(format!("{written:?}").as_bytes());
    })
}

/// The hash of all names, each with what `add` adds of its file.
fn hashed(add: impl Fn(&str, &mut blake3::Hasher)) -> String {
    let mut names: Vec<_> = Files::iter().collect();
    names.sort_unstable();
    let mut hasher = blake3::Hasher::new();
    hasher.update(palette().as_bytes());
    for name in names {
        hasher.update(name.as_bytes());
        hasher.update(&[0]);
        add(&name, &mut hasher);
    }
    hasher.finalize().to_hex()[..12].to_owned()
}
