//! What takes longer: progress, a reload, a cancel, the lists.

use crate::{SETTLED, both};

/// A map of a quarter of a million points: seconds even on a fast machine.
const LONG: &str = "ring-roundness?example=set_up&/setup_map/tool_angles=721&/setup_map/support_angles=361&/setup_map/highest_order=60";

#[test]
fn a_long_job_shows_its_progress_survives_a_reload_and_is_cancelled() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(LONG));
    page.wait_for(".progress-box progress");
    page.until("location.hash.includes('run=')");
    page.until("document.querySelector('.progress-text').textContent.includes('%')");
    page.until("document.querySelector('.count')");

    let address = page.evaluate("location.href");
    page.open(address.as_str().unwrap());
    page.wait_for(".progress-box progress");
    assert_eq!(page.value("#field-setup_map-tool_angles"), "721");

    page.click("#cancel-job");
    page.until("!document.querySelector('.progress-box') && document.querySelector('.problem')?.textContent.includes('Cancelled')");

    page.open(&service.page("jobs"));
    page.until("document.querySelector('.state.cancelled')");
    page.until("/^Radius .* mm · .*feed/.test(document.querySelector('.told').textContent)");
    page.assert_calm();
}

/// A link of a colleague: the form has the inputs of that job, and whatever is done with them, it goes on.
#[test]
fn a_job_that_somebody_else_started_is_shown_with_its_own_inputs_and_never_cancelled() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    let id = page.evaluate(
        "(async () => { const room = await (await fetch('/v1/calculators/ring-roundness')).json(); const job = room.jobs.set_up; \
         Object.assign(job.setup_map, { tool_angles: 721, support_angles: 361, highest_order: 59 }); \
         const answer = await fetch('/v1/ring-roundness', { method: 'POST', body: JSON.stringify(job), \
         headers: { 'Content-Type': 'application/json', Prefer: 'respond-async' } }); return (await answer.json()).id })()",
    );
    let id = id.as_str().unwrap();
    let state = format!("fetch('/v1/jobs/{id}').then(it => it.json()).then(it => it.state)");
    page.open(&service.page(&format!("ring-roundness?run={id}")));
    page.wait_for(".progress-box progress");
    assert_eq!(page.value("#field-setup_map-highest_order"), "59");
    assert_eq!(page.value("#field-setup_map-tool_angles"), "721");

    // What takes long is not begun anew with every letter, and theirs is still the one that is watched.
    page.fill("#field-setup_map-highest_order", "58");
    page.wait_for(".form-head .calling");
    assert!(page.evaluate("location.hash").as_str().unwrap().contains(id));
    page.click(".form-head .primary");
    page.until(&format!("/run=/.test(location.hash) && !location.hash.includes('{id}')"));
    page.wait_for("#cancel-job");
    assert_ne!(page.evaluate(&state), "cancelled");
    // The one that was started here ends when it is not wanted any more.
    page.evaluate("window.own = location.hash.match(/run=([0-9a-f-]+)/)[1]");
    page.fill("#field-setup_map-highest_order", "57");
    page.wait_for(".form-head .calling");
    page.click(".form-head .primary");
    page.until("!location.hash.includes(own)");
    let over = "(async () => { for (let state = ''; !['cancelled', 'succeeded'].includes(state);) state = (await (await fetch(`/v1/jobs/${own}`)).json()).state; return 'over' })()";
    assert_eq!(page.evaluate(over), "over");
    assert_eq!(page.evaluate("fetch(`/v1/jobs/${own}`).then(it => it.json()).then(it => it.state)"), "cancelled");
    assert_ne!(page.evaluate(&state), "cancelled");
    page.evaluate(&format!("fetch('/v1/jobs/{id}', {{ method: 'DELETE' }}).then(() => null)"));
    page.wait_for("#cancel-job");
    page.click("#cancel-job");
    page.until("document.querySelector('.problem')?.textContent.includes('Cancelled')");

    // Cancelled by its owner it is told so, with its inputs, and not begun anew.
    page.open(&service.page(&format!("ring-roundness?run={id}")));
    page.until("document.querySelector('.problem')?.textContent.includes('Cancelled')");
    assert_eq!(page.value("#field-setup_map-highest_order"), "59");
    assert_eq!(page.evaluate("document.querySelector('.progress-box')"), serde_json::Value::Null);
    page.assert_calm();
}

#[test]
fn kept_results_are_listed_and_opened_without_computing() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability"));
    page.until(SETTLED);
    let verdict = page.text(".verdict");
    page.open(&service.page("results"));
    page.wait_for(".list tbody a");
    // It says what it is a result of, in the language of the page.
    page.until("/^Diameter 100 mm · .*depth 3 mm/.test(document.querySelector('.told').textContent)");
    page.click_on("RU");
    page.until("/^Диаметр 100 мм · .*глубина резания 3 мм/.test(document.querySelector('.told')?.textContent)");
    page.click_on("EN");
    page.until("/^Diameter/.test(document.querySelector('.told')?.textContent)");
    // Names of calculators come by themselves.
    page.until("document.querySelector('.list tbody a').textContent === 'Fixture stability'");
    page.click(".list tbody a");
    page.until(&format!("{SETTLED} && location.hash.includes('result=b3:')"));
    assert_eq!(page.text(".verdict"), verdict);
    // Changed, it is computed again.
    page.fill("#field-cut-depth_mm", "1.25");
    page.until(&format!(
        "document.querySelector('.verdict').textContent !== {} && {SETTLED}",
        serde_json::json!(verdict)
    ));
    // What came one after the other from one page is one line of the list until asked for.
    page.open(&service.page("results"));
    page.wait_for(".list tbody .quiet-button");
    assert_eq!(page.evaluate("document.querySelectorAll('.list tbody tr').length"), 1);
    page.click(".list tbody .quiet-button");
    page.until(
        "document.querySelectorAll('.list tbody tr').length >= 2 && !document.querySelector('.list .quiet-button')",
    );
    page.assert_calm();
}

/// What was asked of one result and comes after that of the next one is not shown as the next one's.
#[test]
fn a_program_that_comes_late_replaces_no_newer_one() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.click("#tab-program");
    page.wait_for("[role=tabpanel] pre");
    // The next program hangs on its way; none that is asked for after it.
    page.evaluate(
        "(() => { const own = window.fetch; const gate = new Promise(open => { window.openGate = open }); window.held = null; \
         window.fetch = (path, options) => { const asked = own(path, options); \
         if (options?.headers?.Accept !== 'text/x-gcode' || window.held) return asked; \
         window.held = asked.then(async answer => { const text = await answer.text(); await gate; return new Response(text) }); \
         return window.held } })()",
    );
    page.fill("#field-cut-feed_mm_per_rev", "0.4");
    page.until("held && location.hash.includes('feed_mm_per_rev=0.4')");
    // Until it is there the one before is not offered as its own.
    page.until("document.querySelector('[role=tabpanel] .copy').disabled");
    page.fill("#field-cut-feed_mm_per_rev", "0.3");
    page.until(&format!("location.hash.includes('feed_mm_per_rev=0.3') && {SETTLED}"));
    page.until("document.querySelector('[role=tabpanel] .copy').disabled === false");
    let shown = page.text("[role=tabpanel] pre");
    page.evaluate("(openGate(), held.catch(() => {}).then(() => new Promise(done => setTimeout(done, 50))))");
    assert_eq!(page.text("[role=tabpanel] pre"), shown);
    page.click("#tab-basis");
    page.wait_for("[role=tabpanel] .key-text");
    let own = page.evaluate(
        "fetch('/v1/results/' + document.querySelector('.key-text').textContent, {headers: {Accept: 'text/x-gcode'}}).then(it => it.text())",
    );
    let first = |text: &str| text.lines().take(100).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(first(&shown), first(own.as_str().unwrap()));
    page.assert_calm();
}

#[test]
fn a_service_that_goes_away_is_said_and_nothing_typed_is_lost() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    drop(service);
    page.fill("#field-cut-feed_mm_per_rev", "0.4");
    page.wait_for(".banner[role=status]");
    assert_eq!(page.value("#field-cut-feed_mm_per_rev"), "0.4");
    page.assert_calm();
}
