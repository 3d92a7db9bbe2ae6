//! What is around the pages: the address, the navigation, the lists that take files.

use crate::both;

#[test]
fn an_address_that_is_no_encoding_is_the_address_of_no_page() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("%"));
    page.until("document.querySelector('main h1')?.textContent === 'There is no such page'");
    // The same on the way from a page that there is.
    page.evaluate("location.hash = '#/jobs'");
    page.until("document.querySelector('main h1').textContent === 'Jobs'");
    page.evaluate("location.hash = '#/%E0%A4%A'");
    page.until("document.querySelector('main h1').textContent === 'There is no such page'");
    page.click("main a");
    page.wait_for(".questions li");
    page.assert_calm();
}

/// A model that was refused is mended in its file and chosen again, under the same name.
#[test]
fn the_same_file_is_imported_a_second_time() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("models"));
    page.wait_for("input[type=file]");
    page.evaluate(
        "(() => { const own = window.fetch; window.sent = 0; window.fetch = (path, options) => { \
         if (options?.method === 'PUT') window.sent += 1; return own(path, options) } })()",
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lathe-7.json");
    std::fs::write(&file, "{\"name\": \"lathe-7\"}").unwrap();
    for times in 1..=2 {
        page.choose_file("input[type=file]", &file);
        page.until(&format!("sent === {times} && document.querySelector('.problem[role=alert]')"));
    }
    page.assert_calm();
}

/// The count beside *Jobs*: each job once, the newest look alone, and no more than were counted.
#[test]
fn open_jobs_are_counted_once_and_an_older_look_changes_nothing() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    page.wait_for(".questions li");
    page.evaluate(
        "(() => { const own = window.fetch; const job = id => ({ id, state: 'running' }); \
         const answer = jobs => new Response(JSON.stringify(jobs), { headers: { 'Content-Type': 'application/json' } }); \
         window.next = null; window.items = []; window.held = []; window.holds = false; \
         window.count = (ids, next) => { window.items = ids.map(job); window.next = next ?? null; document.dispatchEvent(new Event('visibilitychange')) }; \
         window.fetch = async (path, options) => { if (!String(path).startsWith('/v1/jobs?state=')) return own(path, options); \
         const found = { items: window.items, next: window.next }; \
         if (window.holds) await new Promise(go => held.push(go)); \
         return answer(found) } })()",
    );
    let count = "document.querySelector('.shell .count span')?.textContent ?? ''";
    // One that waited in the first list runs in the second.
    page.evaluate("count(['a'])");
    page.until(&format!("({count}) === '1'"));
    // A look that hangs tells of five; the next one of two.
    page.evaluate("(holds = true, count(['a', 'b', 'c', 'd', 'e']), holds = false, count(['a', 'b']))");
    page.until(&format!("({count}) === '2'"));
    page.evaluate("new Promise(done => { held.forEach(go => go()); setTimeout(done, 50) })");
    assert_eq!(page.evaluate(count), "2");
    page.evaluate("count(['a', 'b'], '/v1/jobs?after=b')");
    page.until(&format!("({count}) === '2+'"));
    page.evaluate("count([])");
    page.until("!document.querySelector('.shell .count')");
    page.assert_calm();
}
