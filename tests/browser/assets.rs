//! What the page is made of: small, kept for ever under its version, and under a strict content policy.

use reqwest::header::{ACCEPT, ACCEPT_ENCODING};

use crate::service::Service;

/// Compressed size of everything that the page loads, bytes.
const MOST_BYTES: usize = 250 * 1000;

#[tokio::test]
async fn the_page_is_small_and_kept_by_its_version() {
    let service = Service::start();
    let client = reqwest::Client::builder().no_gzip().no_brotli().build().unwrap();
    let get = |url: String| client.get(url).header(ACCEPT, "text/html, */*;q=0.5").header(ACCEPT_ENCODING, "br");
    let answer = get(service.url("/")).send().await.unwrap();
    let policy = answer.headers()["content-security-policy"].to_str().unwrap().to_owned();
    for part in
        ["default-src 'none'", "script-src 'self'", "style-src 'self'", "connect-src 'self'", "frame-ancestors 'none'"]
    {
        assert!(policy.contains(part), "{policy}");
    }
    assert!(!policy.contains("unsafe"), "{policy}");
    let mut total = answer.bytes().await.unwrap().len();
    let page = client.get(service.url("/")).header(ACCEPT, "text/html").send().await.unwrap().text().await.unwrap();
    assert!(!page.contains("<style") && !page.contains("http://") && !page.contains("https://"));
    let mut files: Vec<&str> = page.split('"').filter(|part| part.starts_with("/ui/")).collect();
    files.sort_unstable();
    files.dedup();
    assert!(files.len() > 12, "{files:?}");
    let version = files[0].split('/').nth(2).unwrap();
    let texts = ["en", "ru"].map(|tag| format!("/ui/{version}/text/{tag}.json"));
    let pictures = format!("/ui/{version}/outcomes.json");
    for file in files.iter().copied().chain(texts.iter().map(String::as_str)).chain([pictures.as_str()]) {
        let answer = get(service.url(file)).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{file}");
        assert_eq!(answer.headers()["cache-control"], "public, max-age=31536000, immutable", "{file}");
        total += answer.bytes().await.unwrap().len();
    }
    eprintln!("the workbench is {total} bytes compressed");
    assert!(total < MOST_BYTES, "{total} bytes");
    // Another version's address leads to what there is now, not to be kept.
    let other = get(service.url("/ui/0123456789ab/main.js")).send().await.unwrap();
    assert_eq!(other.headers()["cache-control"], "no-cache");
    for absent in
        ["/ui/0123456789ab/nothing.js", "/ui/0123456789ab/vendor/LICENSE-preact.txt", "/ui/0123456789ab/../Cargo.toml"]
    {
        assert_eq!(get(service.url(absent)).send().await.unwrap().status(), 404, "{absent}");
    }
}
